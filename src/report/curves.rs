//! [`Chart`], the frame of a drawing, and the IsoFLOP curves: every run, and the predicted optimum.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::input::{Study, Words, budgets, of_budget};
use crate::laws::text::count;
use crate::predict::Prediction;
use crate::record::RunRecord;

/// Pixels of the whole, and of the margins.
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 420.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 46.0;

/// Margin around the outermost values, as a fraction of their span.
const ROOM: f64 = 0.04;

/// A plot with a logarithmic x axis and a linear y axis.
pub struct Chart {
    /// Logarithms to base 10.
    x: [f64; 2],
    y: [f64; 2],
}

impl Chart {
    /// A chart that holds all points; `None` without points.
    pub fn around(points: impl IntoIterator<Item = (f64, f64)>) -> Option<Self> {
        let usable = points.into_iter().map(|(x, y)| (x.log10(), y));
        let usable = usable.filter(|(x, y)| x.is_finite() && y.is_finite());
        let joined = |[low, high]: [f64; 2], own: [f64; 2]| [low.min(own[0]), high.max(own[1])];
        let all = usable.map(|(x, y)| [[x, x], [y, y]]);
        let [x, y] = all.reduce(|[x, y], own| [joined(x, own[0]), joined(y, own[1])])?.map(roomy);
        Some(Self { x, y })
    }

    /// Pixels from the left.
    pub fn x(&self, value: f64) -> f64 {
        let [low, high] = self.x;
        LEFT + (value.log10() - low) / (high - low) * (WIDTH - LEFT - RIGHT)
    }

    /// Pixels from the top.
    pub fn y(&self, value: f64) -> f64 {
        let [low, high] = self.y;
        HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - TOP - BOTTOM)
    }

    /// Pixels from the left, clamped to the plot.
    pub fn x_within(&self, value: f64) -> f64 {
        self.x(value).clamp(LEFT, WIDTH - RIGHT)
    }

    /// Whether a value lies within the y axis.
    pub fn holds(&self, value: f64) -> bool {
        (self.y[0]..=self.y[1]).contains(&value)
    }

    /// A line through values.
    pub fn path(&self, points: impl IntoIterator<Item = (f64, f64)>) -> String {
        let at = |(place, (x, y)): (usize, (f64, f64))| {
            let letter = if place == 0 { 'M' } else { 'L' };
            format!("{letter}{:.1} {:.1}", self.x(x), self.y(y))
        };
        points.into_iter().enumerate().map(at).collect()
    }

    /// The drawing, with named axes around it.
    pub fn drawing(&self, id: &str, about: &str, [x, y]: [&str; 2], within: &Markup) -> Markup {
        let middle = (LEFT + WIDTH - RIGHT) / 2.0;
        let centre = (TOP + HEIGHT - BOTTOM) / 2.0;
        let clip = format!("{id}-plot");
        html! {
            div.wide tabindex="0" role="region" aria-label=(about) {
            svg.chart id=(id) viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label=(about) {
                @for (value, name) in self.ticks_x() {
                    line.grid x1=(px(self.x(value))) x2=(px(self.x(value))) y1=(TOP) y2=(HEIGHT - BOTTOM) {}
                    text x=(px(self.x(value))) y=(HEIGHT - BOTTOM + 16.0) text-anchor="middle" { (name) }
                }
                @for (value, name) in self.ticks_y() {
                    line.grid x1=(LEFT) x2=(WIDTH - RIGHT) y1=(px(self.y(value))) y2=(px(self.y(value))) {}
                    text x=(LEFT - 6.0) y=(px(self.y(value) + 4.0)) text-anchor="end" { (name) }
                }
                text x=(middle) y=(HEIGHT - 8.0) text-anchor="middle" { (x) }
                text transform={ "translate(14 " (centre) ") rotate(-90)" } text-anchor="middle" { (y) }
                clipPath id=(clip) {
                    rect x=(LEFT) y=(TOP) width=(WIDTH - LEFT - RIGHT) height=(HEIGHT - TOP - BOTTOM) {}
                }
                g clip-path={ "url(#" (clip) ")" } { (within) }
            }
            }
        }
    }

    /// 1, and if there is room 2 and 5, times each power of ten.
    fn ticks_x(&self) -> Vec<(f64, String)> {
        let [low, high] = self.x;
        let steps: &[f64] = if high - low < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let powers = low.floor() as i32..=high.ceil() as i32;
        let all = powers.flat_map(|power| steps.iter().map(move |step| step * 10f64.powi(power)));
        let within = all.filter(|value| (low..=high).contains(&value.log10()));
        within.map(|value| (value, short(value))).collect()
    }

    fn ticks_y(&self) -> Vec<(f64, String)> {
        let [low, high] = self.y;
        let rough = (high - low) / 5.0;
        let power = 10f64.powf(rough.log10().floor());
        let mut steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power).into_iter();
        let step = steps.find(|step| *step >= rough).unwrap_or(power);
        let digits = (-step.log10().floor()).max(0.0) as usize;
        let range = (low / step).ceil() as i64..=(high / step).floor() as i64;
        range.map(|i| (i as f64 * step, format!("{:.digits$}", i as f64 * step))).collect()
    }
}

fn roomy([low, high]: [f64; 2]) -> [f64; 2] {
    let room = if high > low { ROOM * (high - low) } else { 0.5 };
    [low - room, high + room]
}

/// Pixels as text.
pub fn px(value: f64) -> String {
    format!("{value:.1}")
}

/// A value on an axis: 500, 20k, 1e10.
fn short(value: f64) -> String {
    match value {
        value if value >= 1e7 => format!("{value:.0e}"),
        value if value >= 1e6 => format!("{:.0}M", value / 1e6),
        value if value >= 1e3 => format!("{:.0}k", value / 1e3),
        value => format!("{value}"),
    }
}

// The IsoFLOP curves.

/// The curves; `None` if no run has a loss.
pub fn isoflop(study: &Study) -> Option<Markup> {
    let budgets = budgets(study.records);
    let best = budgets.iter().flat_map(|budget| best_of_sizes(study.records, *budget));
    let chart = Chart::around(best.filter_map(point))?;
    // The style has eight colours; further budgets begin again.
    let colour = |place: usize| format!("c{}", place % 8);
    let drawn = html! {
        (optimum(&chart, study))
        @for (place, budget) in budgets.iter().enumerate() {
            (curve(&chart, study, *budget, &colour(place)))
        }
    };
    let Words { size, loss, loss_axis, .. } = study.words();
    let about = format!(
        "{loss} of runs against {size}, with a line through the best of each size of a budget"
    );
    let within = html! {
        p { "The lines go through the best run of each size; the other runs are faint. Point at a run, or \
        tap it, to read its values. The shaded band is the predicted " (size) " for the budget chosen above." }
        (chart.drawing(&study.id("isoflop"), &study.own(&about), [size, &loss_axis], &drawn))
        p.pointed aria-live="polite" { "\u{a0}" }
        ul.legend {
            @for (place, budget) in budgets.iter().enumerate() {
                li { span class={ "swatch " (colour(place)) } {} (count(*budget)) }
            }
        }
    };
    Some(study.section("curves", "IsoFLOP curves", &within))
}

fn curve(chart: &Chart, study: &Study, budget: f64, colour: &str) -> Markup {
    let (records, words) = (study.records, study.words());
    let best = best_of_sizes(records, budget);
    let is_best =
        |record: &RunRecord| best.iter().any(|best| best.planned.run_id == record.planned.run_id);
    html! {
        g class=(colour) {
            path.line d=(chart.path(best.iter().copied().filter_map(point))) {}
            @for record in of_budget(records, budget) {
                @if let Some((x, y)) = point(record).filter(|(_, y)| chart.holds(*y)) {
                    circle.best[is_best(record)] cx=(px(chart.x(x))) cy=(px(chart.y(y)))
                        r=(if is_best(record) { "4" } else { "2.5" }) data-label=(label(record, &words)) {}
                }
            }
        }
    }
}

/// The band of the predicted N_nv, moved by the slider.
fn optimum(chart: &Chart, study: &Study) -> Markup {
    let (top, bottom) = (TOP, HEIGHT - BOTTOM);
    let place = |prediction: &Prediction| {
        let size = prediction.at.size().copied().unwrap_or(f64::NAN);
        let [low, high] = prediction.ci95.at.size().copied().unwrap_or([size, size]);
        [size, low, high].map(|x| px(chart.x_within(x))).join(" ")
    };
    let places: Vec<String> = study.predictions.iter().map(place).collect();
    html! {
        g.optimum data-places=(places.join(",")) {
            rect y=(top) height=(bottom - top) x="0" width="0" {}
            line y1=(top) y2=(bottom) x1="0" x2="0" {}
        }
    }
}

/// N_nv and L_u of a run, if it has a loss.
fn point(record: &RunRecord) -> Option<(f64, f64)> {
    Some((record.planned.params_nonvocab as f64, record.loss_normalised().ok()?))
}

/// The lowest L_u of each N_nv at a budget, with its run.
fn best_of_sizes(records: &[RunRecord], budget: f64) -> Vec<&RunRecord> {
    let mut best: BTreeMap<usize, (&RunRecord, f64)> = BTreeMap::new();
    for record in of_budget(records, budget) {
        let Ok(loss) = record.loss_normalised() else { continue };
        let kept = best.entry(record.planned.params_nonvocab).or_insert((record, loss));
        if loss < kept.1 {
            *kept = (record, loss);
        }
    }
    best.into_values().map(|(record, _)| record).collect()
}

/// A run in a line.
fn label(record: &RunRecord, words: &Words) -> String {
    let planned = &record.planned;
    let Words { size, loss, has_vocab, .. } = words;
    let told = record.loss_normalised();
    let told = told.map_or("no loss".to_string(), |own| format!("{loss} {own:.4}"));
    let vocab = if *has_vocab { format!(", V {}", planned.n_vocab) } else { String::new() };
    let generator = planned.generator.as_deref().unwrap_or("run");
    let seed = planned.seed.map(|seed| format!(", seed {seed}")).unwrap_or_default();
    let [n, c] = [planned.params_nonvocab as f64, planned.budget_flops].map(count);
    let d = count(record.measured.tokens as f64);
    format!("{generator}, {size} {n}{vocab}, C {c}, D {d}{seed}: {told}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_lie_within_the_frame_and_rise_to_the_right_and_up() {
        let chart = Chart::around([(1e3, -4.0), (1e5, -2.0), (f64::NAN, 0.0)]).unwrap();
        assert!(LEFT < chart.x(1e3) && chart.x(1e3) < chart.x(1e4));
        assert!(chart.x(1e5) < WIDTH - RIGHT && (chart.x(1e9) > WIDTH));
        assert_eq!(chart.x_within(1e9), WIDTH - RIGHT);
        assert!(chart.y(-2.0) < chart.y(-4.0) && chart.y(-2.0) > TOP);
        let ticks: Vec<String> = chart.ticks_x().into_iter().map(|(_, name)| name).collect();
        assert_eq!(ticks, ["1k", "2k", "5k", "10k", "20k", "50k", "100k"]);
        let ticks: Vec<String> = chart.ticks_y().into_iter().map(|(_, name)| name).collect();
        assert_eq!(ticks, ["-4.0", "-3.5", "-3.0", "-2.5", "-2.0"]);
        assert!(Chart::around([]).is_none());
        assert!(Chart::around([(10.0, 1.0)]).is_some(), "one point has room around it");
    }
}
