//! The codes of a tokenizer, scale by scale: how often each is met, and where they lie (LG-Tok, Figs. 6
//! and 7).

use super::axis::{Axis, Scale};
use super::colour::MUTED;
use super::legend::{Legend, Sample};
use super::page::{Page, Plot};
use super::panel::Panel;
use super::scene::{Dash, Marker, Point, Scene, Stroke};
use super::series::{Look, ordered_looks};
use crate::tokenizer::{CodeMap, ScaleCodes};

/// Radius of a code's mark that is met as often as it would be if all were alike.
const RADIUS: f64 = 2.4;
/// Largest radius.
const LARGEST: f64 = 9.0;

/// The page, or the reason why there is none.
pub fn draw(title: &str, map: &CodeMap) -> Result<Scene, String> {
    let looks = looks(map.scales.len());
    let (mut scene, panels) = page(title, map, &looks).panels(vec![use_plot(map)?, map_plot(map)?]);
    let [by_use, by_place] = &panels[..] else { unreachable!("two plots") };
    by_use.backdrop(&mut scene);
    by_use.line(&mut scene, &[(0.0, 1.0), (100.0, 1.0)], alike());
    for (scale, look) in map.scales.iter().zip(&looks) {
        by_use.line(&mut scene, &by_rank(scale), look.stroke());
    }
    by_place.backdrop(&mut scene);
    for (scale, look) in map.scales.iter().zip(&looks) {
        draw_places(&mut scene, by_place, scale, *look);
    }
    Ok(scene)
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
    legend.entry(Sample::Line(alike()), "all codes alike");
    let remarks = "Codes of the test split. Left: a code's share of its scale's, times the size of the \
                   codebook. Right: the embeddings of the codes that were met, a mark the larger the \
                   more often."
        .to_owned();
    Page { width: 1100.0, height: 560.0, title: title.to_owned(), remarks, legend }
}

fn use_plot(map: &CodeMap) -> Result<Plot, String> {
    let points: Vec<Point> = map.scales.iter().flat_map(by_rank).collect();
    let x =
        Axis::new("Codes of a scale, the most frequent first (%)", Scale::Linear, [0.0, 100.0])?;
    let frequencies = points.iter().map(|point| point.1);
    let y = Axis::new("Frequency (1: all alike)", Scale::Log, frequencies.chain([1.0]))?;
    Ok(Plot { title: vec!["Use".to_owned()], x, y })
}

fn map_plot(map: &CodeMap) -> Result<Plot, String> {
    let met = || map.scales.iter().flat_map(ScaleCodes::that_were_met).map(|(place, _)| place);
    let label = |i: usize| {
        let order = ["First", "Second"][i];
        format!("{order} component ({:.0} % of variance)", 100.0 * map.explained[i])
    };
    let x = Axis::new(&label(0), Scale::Linear, met().map(|place| place[0]))?;
    let y = Axis::new(&label(1), Scale::Linear, met().map(|place| place[1]))?;
    Ok(Plot { title: vec!["Embeddings".to_owned()], x, y })
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

fn draw_places(scene: &mut Scene, panel: &Panel, scale: &ScaleCodes, look: Look) {
    for ([x, y], frequency) in scale.that_were_met() {
        let radius = (RADIUS * frequency.sqrt()).clamp(0.8, LARGEST);
        panel.mark(scene, (x, y), super::scene::Mark { radius, ..look.mark() });
    }
}

/// What every code would be met at if all were alike.
fn alike() -> Stroke {
    Stroke::solid(MUTED, 1.3).dash(Dash::Dashed)
}
