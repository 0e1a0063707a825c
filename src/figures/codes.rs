//! The codes of a tokenizer, scale by scale: how often each is met, and where they lie (LG-Tok, Figs. 6
//! and 7).

use super::{
    Axis, Drawing, Legend, Look, Mark, Marker, Page, Plot, Point, Sample, Scale, bound_stroke,
    ordered_looks,
};
use crate::tokenizer::{CodeMap, ScaleCodes};

/// Radius of a code's mark that is met as often as it would be if all were alike.
const RADIUS: f64 = 2.4;
/// Largest radius.
const LARGEST: f64 = 9.0;

/// The page, or the reason why there is none.
pub fn draw(title: &str, map: &CodeMap) -> Drawing {
    let looks = looks(map.scales.len());
    let plots = vec![use_plot(map, &looks)?, map_plot(map, &looks)?];
    Ok(page(title, map, &looks).panels(plots))
}

/// Scales are many and overlap: circles, dark to light.
fn looks(n: usize) -> Vec<Look> {
    let circle = |look| Look { marker: Marker::Circle, ..look };
    ordered_looks(n).into_iter().map(circle).collect()
}

fn page(title: &str, map: &CodeMap, looks: &[Look]) -> Page {
    let mut legend = Legend::default();
    legend.heading("Scale: codes in use");
    for (i, (scale, look)) in map.scales.iter().zip(looks).enumerate() {
        let (all, used) = (scale.places.len(), scale.met.utilisation());
        let sample = Sample::MarkedLine(look.stroke(), look.mark());
        legend.entry(sample, format!("{}: {:.0} % of {all}", i + 1, 100.0 * used));
    }
    legend.heading("Bound");
    legend.entry(Sample::Line(bound_stroke()), "all codes alike");
    let remarks = "Codes of the test split. Left: a code's share of its scale's, times the size of the \
                   codebook. Right: the embeddings of the codes that were met, a mark the larger the \
                   more often."
        .to_owned();
    Page { width: 1100.0, height: 560.0, title: title.to_owned(), remarks, legend }
}

fn use_plot(map: &CodeMap, looks: &[Look]) -> Result<Plot, String> {
    let lines: Vec<Vec<Point>> = map.scales.iter().map(by_rank).collect();
    let label = "Codes of a scale, the most frequent first (%)";
    let x = Axis::new(label, Scale::Linear, [0.0, 100.0])?;
    let frequencies = lines.iter().flatten().map(|point| point.1);
    let y = Axis::new("Frequency (1: all alike)", Scale::Log, frequencies.chain([1.0]))?;
    let mut plot = Plot::new(["Use".to_owned()], x, y);
    plot.line([(0.0, 1.0), (100.0, 1.0)], bound_stroke());
    lines.into_iter().zip(looks).for_each(|(line, look)| plot.line(line, look.stroke()));
    Ok(plot)
}

fn map_plot(map: &CodeMap, looks: &[Look]) -> Result<Plot, String> {
    let axis = |i: usize| {
        let met = map.scales.iter().flat_map(ScaleCodes::that_were_met);
        let order = ["First", "Second"][i];
        let label = format!("{order} component ({:.0} % of variance)", 100.0 * map.explained[i]);
        Axis::new(&label, Scale::Linear, met.map(|(place, _)| place[i]))
    };
    let mut plot = Plot::new(["Embeddings".to_owned()], axis(0)?, axis(1)?);
    for (scale, look) in map.scales.iter().zip(looks) {
        for ([x, y], frequency) in scale.that_were_met() {
            let radius = (RADIUS * frequency.sqrt()).clamp(0.8, LARGEST);
            plot.mark((x, y), Mark { radius, ..look.mark() });
        }
    }
    Ok(plot)
}

/// Frequencies of the codes that were met, falling, in units of that which all would have if they were
/// alike, against the share of the codebook.
fn by_rank(scale: &ScaleCodes) -> Vec<Point> {
    let mut frequencies: Vec<f64> = scale.that_were_met().map(|(_, frequency)| frequency).collect();
    frequencies.sort_unstable_by(|a, b| b.total_cmp(a));
    let all = scale.places.len() as f64;
    let point = |(rank, frequency)| (100.0 * (rank as f64 + 0.5) / all, frequency);
    frequencies.into_iter().enumerate().map(point).collect()
}
