//! FID, R@1, jerk and foot skate of runs against their L_u and their compute: does the loss carry over to quality?

use std::collections::BTreeMap;

use super::axis::{Axis, COMPUTE, Scale};
use super::cells::Drawing;
use super::legend::{Legend, Sample, bound_stroke, category_looks};
use super::page::Page;
use super::panel::Plot;
use super::scene::Point;
use crate::record::Quality;
use crate::scores::rank_correlation;

/// An axis: its label, its scale, and its values.
struct Quantity {
    label: &'static str,
    scale: Scale,
    of: fn(&Quality) -> Option<f64>,
    /// The same of true motions.
    of_truth: fn(&Quality) -> Option<f64>,
}

const LOSS: Quantity = Quantity {
    label: "Normalised loss Lᵤ (nats)",
    scale: Scale::Linear,
    of: |row| row.run.loss_normalised().ok(),
    of_truth: |_| None,
};

const BUDGET: Quantity = Quantity {
    label: COMPUTE,
    scale: Scale::Log,
    of: |row| Some(row.run.planned.budget_flops),
    of_truth: |_| None,
};

const FID: Quantity =
    Quantity { label: "FID", scale: Scale::Log, of: |row| row.mean("fid"), of_truth: |_| None };

const PRECISION: Quantity = Quantity {
    label: "R@1 in pools of 32",
    scale: Scale::Linear,
    of: |row| row.mean("r_precision_1"),
    of_truth: |row| row.mean("truth_r_precision_1"),
};

const JERK: Quantity = Quantity {
    label: "Jerk (m/s³)",
    scale: Scale::Linear,
    of: |row| row.mean("jerk"),
    of_truth: |row| row.mean("truth_jerk"),
};

const SKATE: Quantity = Quantity {
    label: "Foot skate (share of steps)",
    scale: Scale::Linear,
    of: |row| row.mean("foot_skate"),
    of_truth: |row| row.mean("truth_foot_skate"),
};

/// The quantities of each panel, x and y.
const PANELS: [[Quantity; 2]; 6] = [
    [LOSS, FID],
    [LOSS, PRECISION],
    [BUDGET, JERK],
    [BUDGET, FID],
    [BUDGET, PRECISION],
    [BUDGET, SKATE],
];

/// FID and R@1 against L_u and compute, jerk and foot skate against compute; or the reason why there is no page.
pub fn quality(sweep: &str, rows: &[Quality]) -> Drawing {
    if rows.len() < 2 {
        return Err(format!("it needs two scored runs, there are {}", rows.len()));
    }
    // Runs by generator and vocabulary.
    let mut series: BTreeMap<_, Vec<&Quality>> = BTreeMap::new();
    for row in rows {
        series.entry((row.generator(), row.run.planned.n_vocab)).or_default().push(row);
    }
    let looks = category_looks(series.len());
    let plot = |[along, up]: &[Quantity; 2]| {
        let mut plot = plot([along, up], rows)?;
        for (own, look) in series.values().zip(&looks) {
            plot.marks(own.iter().filter_map(|row| point(along, up, row)), *look);
        }
        Ok(plot)
    };
    let plots = PANELS.iter().map(plot).collect::<Result<Vec<_>, String>>()?;
    let mut legend = Legend::headed("Generator, V");
    for ((generator, n_vocab), look) in series.keys().zip(&looks) {
        legend.entry(Sample::Mark(look.mark()), format!("{generator} {n_vocab}"));
    }
    legend.heading("Bound");
    legend.entry(Sample::Line(bound_stroke()), "true motions");
    let (n, judge) = (rows.len(), &rows[0].evaluator_id);
    let same = "comparable only with scores of the same evaluator";
    let remarks = format!("{n} runs, scored by evaluator {judge}; {same}.");
    let title = format!("{sweep}: quality of motions against loss and compute");
    Ok(Page { width: 1360.0, height: 760.0, title, remarks, legend }.panels(plots))
}

fn point(along: &Quantity, up: &Quantity, row: &Quality) -> Option<Point> {
    Some(((along.of)(row)?, (up.of)(row)?))
}

fn plot([along, up]: [&Quantity; 2], rows: &[Quality]) -> Result<Plot, String> {
    let values = |quantity: &Quantity| rows.iter().filter_map(quantity.of).collect::<Vec<f64>>();
    // The scores of true motions.
    let truth: Vec<f64> = rows.iter().filter_map(up.of_truth).collect();
    let x = Axis::new(along.label, along.scale, values(along))?;
    let y = Axis::new(up.label, up.scale, values(up).into_iter().chain(truth.iter().copied()))?;
    // Compute differs between budgets alone.
    let is_within = along.label != BUDGET.label;
    let pairs = rows.iter().filter_map(|row| {
        let budget = row.run.planned.budget_flops.to_bits();
        Some((if is_within { budget } else { 0 }, point(along, up, row)?))
    });
    let where_ = if is_within { " within budgets" } else { "" };
    let is_one = rows.iter().all(|row| row.generator() == rows[0].generator());
    let title = rank_correlation(pairs).ok().filter(|_| is_one).map(|rank| {
        let ([low, high], value) = (rank.interval, rank.value);
        format!("rank correlation{where_} {value:.2} (95 %: {low:.2} to {high:.2})")
    });
    let mut plot = Plot::new(title, x, y);
    if let Some(truth) = truth.first() {
        plot.curve(plot.x.ends(), |_| *truth, bound_stroke());
    }
    Ok(plot)
}
