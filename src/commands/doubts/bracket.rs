//! Budgets whose expected optimum lies outside what is tried.

use super::doubt::{Doubt, at};
use super::tried::Tried;
use crate::commands::expected::Expected;

/// What is tried in sizes, or in vocabularies.
struct Axis {
    /// The flag of a minimum at an end of it.
    kind: &'static str,
    noun: &'static str,
    symbol: &'static str,
    /// What to change, with `{}` for smaller or larger.
    mend: &'static str,
    outside: fn(&Tried, &Expected) -> Option<Outside>,
}

static AXES: [Axis; 2] = [
    Axis {
        kind: "not-bracketed",
        noun: "size",
        symbol: "N_nv",
        mend: "add {} models there",
        outside: size_outside,
    },
    Axis {
        kind: "edge-vocab",
        noun: "vocabulary",
        symbol: "V",
        mend: "add {} vocabularies, or the minima there are flagged",
        outside: vocab_outside,
    },
];

/// An optimum outside: on which side, where it is expected, and what ends before it.
struct Outside {
    is_below: bool,
    budget_flops: f64,
    expected: f64,
    end: f64,
    by: &'static str,
}

pub fn doubts(budgets: &[Tried]) -> Vec<Doubt> {
    let known = budgets.iter().filter(|budget| budget.has_law);
    let known: Vec<(&Tried, Expected)> =
        known.filter_map(|budget| Some((budget, Expected::of(budget.budget_flops)?))).collect();
    let sides =
        [true, false].into_iter().flat_map(|side| AXES.iter().map(move |axis| (side, axis)));
    let told = |(is_below, axis): (bool, &Axis)| {
        let outside =
            known.iter().filter_map(|(budget, expected)| (axis.outside)(budget, expected));
        let found: Vec<Outside> = outside.filter(|found| found.is_below == is_below).collect();
        told(axis, &found, budgets.len())
    };
    sides.filter_map(told).collect()
}

/// The sizes of a budget end before its expected optimum.
fn size_outside(tried: &Tried, expected: &Expected) -> Option<Outside> {
    let [first, .., last] = &tried.sizes[..] else { return None };
    let ends = [first.params_nonvocab, last.params_nonvocab];
    outside(tried, expected, (expected.params_nonvocab, 1.0), ends)
}

/// Its vocabularies do. V follows from N_v at the width of the size nearest to the optimum.
fn vocab_outside(tried: &Tried, expected: &Expected) -> Option<Outside> {
    let [first, .., last] = tried.vocab[..] else { return None };
    let off = |n: f64| (n / expected.params_nonvocab).ln().abs();
    let nearest = tried
        .sizes
        .iter()
        .min_by(|a, b| off(a.params_nonvocab).total_cmp(&off(b.params_nonvocab)))?;
    let n_vocab = expected.params_vocab / nearest.d_model as f64;
    outside(tried, expected, (n_vocab, expected.vocab_within), [first as f64, last as f64])
}

/// An optimum that lies outside the ends, by however much within a factor it may be otherwise.
fn outside(
    tried: &Tried,
    law: &Expected,
    (expected, within): (f64, f64),
    [first, last]: [f64; 2],
) -> Option<Outside> {
    let is_below = expected * within <= first;
    let end = if is_below { first } else { last };
    let found = Outside { is_below, budget_flops: tried.budget_flops, expected, end, by: law.by };
    (is_below || expected / within >= last).then_some(found)
}

fn told(axis: &Axis, found: &[Outside], all: usize) -> Option<Doubt> {
    // The one furthest out stands for all.
    let off = |outside: &Outside| (outside.expected / outside.end).ln().abs();
    let worst = found.iter().max_by(|a, b| off(a).total_cmp(&off(b)))?;
    let budgets_flops: Vec<f64> = found.iter().map(|outside| outside.budget_flops).collect();
    let Outside { is_below, budget_flops, expected, end, by } = worst;
    let [most, more] = if *is_below { ["smallest", "smaller"] } else { ["largest", "larger"] };
    let there = if found.len() > 1 { format!(" at {budget_flops:e}") } else { String::new() };
    let Axis { noun, symbol, mend, .. } = axis;
    let what = format!(
        "by {by} the optimum lies at or beyond the {most} {noun} tried {}: {symbol} = {expected:.2e}{there}, \
         and {end:.2e} is the {most}",
        at(&budgets_flops, all)
    );
    Some(Doubt { kind: axis.kind, what, mend: mend.replace("{}", more), budgets_flops })
}
