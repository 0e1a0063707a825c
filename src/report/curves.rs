//! The IsoFLOP curves: every run, and where the predicted optimum lies.

use maud::{Markup, html};

use super::chart::{Chart, px};
use super::input::Study;
use super::scaling::{best_of_sizes, budgets, label, of_budget, point};
use crate::laws::text::count;
use crate::record::RunRecord;

/// Colours that the style has; further budgets begin again.
const COLOURS: usize = 8;

/// The curves; `None` where no run has a loss.
pub fn section(study: &Study) -> Option<Markup> {
    let budgets = budgets(study.records);
    let best = budgets.iter().flat_map(|budget| best_of_sizes(study.records, *budget));
    let chart = Chart::around(best.filter_map(point))?;
    let drawn = html! {
        (optimum(&chart, study))
        @for (place, budget) in budgets.iter().enumerate() {
            (curve(&chart, study, *budget, place % COLOURS))
        }
    };
    let words = study.words();
    let about = format!(
        "{} of runs against {}, with a line through the best of each size of a budget",
        words.loss, words.size
    );
    let within = html! {
        p { "The lines go through the best run of each size; the other runs near them are faint. Point \
             at a run, or tap it, to read it. The shaded band is the predicted " (words.size) " of the budget chosen above." }
        (chart.drawing(&study.id("isoflop"), &study.own(&about), [words.size, &words.loss_axis], &drawn))
        p.pointed aria-live="polite" { "\u{a0}" }
        ul.legend {
            @for (place, budget) in budgets.iter().enumerate() {
                li { span class={ "swatch c" (place % COLOURS) } {} (count(*budget)) }
            }
        }
    };
    Some(study.section("curves", "IsoFLOP curves", &within))
}

fn curve(chart: &Chart, study: &Study, budget: f64, colour: usize) -> Markup {
    let (records, words) = (study.records, study.words());
    let best = best_of_sizes(records, budget);
    let is_best =
        |record: &RunRecord| best.iter().any(|best| best.planned.run_id == record.planned.run_id);
    html! {
        g class={ "c" (colour) } {
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

/// The band of the predicted N_nv, which the slider moves.
fn optimum(chart: &Chart, study: &Study) -> Markup {
    let [top, bottom] = chart.height();
    let places: Vec<String> = study
        .predictions
        .iter()
        .map(|prediction| {
            let size = prediction.at.size().copied().unwrap_or(f64::NAN);
            let [low, high] = prediction.ci95.at.size().copied().unwrap_or([size, size]);
            [size, low, high].map(|x| px(chart.x_within(x))).join(" ")
        })
        .collect();
    html! {
        g.optimum data-places=(places.join(",")) {
            rect y=(top) height=(bottom - top) x="0" width="0" {}
            line y1=(top) y2=(bottom) x1="0" x2="0" {}
        }
    }
}
