//! Budgets whose expected optimum lies outside what is tried.

use isoflop::laws::MinimumFlag;

use super::doubt::{Doubt, at};
use super::tried::Tried;
use crate::commands::expected::Expected;

/// A side of what is tried.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Below,
    Above,
}

/// An optimum outside: on which side, where it is expected, and what ends before it.
struct Outside {
    side: Side,
    budget_flops: f64,
    expected: f64,
    end: f64,
    by: &'static str,
}

pub fn doubts(budgets: &[Tried]) -> Vec<Doubt> {
    let known = budgets.iter().filter(|budget| budget.has_law);
    let known: Vec<(&Tried, Expected)> =
        known.filter_map(|budget| Some((budget, Expected::of(budget.budget_flops)?))).collect();
    let sizes = known.iter().filter_map(|(budget, expected)| size_outside(budget, expected));
    let vocab = known.iter().filter_map(|(budget, expected)| vocab_outside(budget, expected));
    let (sizes, vocab): (Vec<_>, Vec<_>) = (sizes.collect(), vocab.collect());
    let all = budgets.len();
    [Side::Below, Side::Above]
        .into_iter()
        .flat_map(|side| {
            let smaller = if side == Side::Below { "smaller" } else { "larger" };
            let models = format!("add {smaller} models there");
            let codes = format!("add {smaller} vocabularies, or the minima there are flagged");
            [
                told(
                    MinimumFlag::NotBracketed,
                    "size",
                    "N_nv",
                    &of_side(&sizes, side),
                    all,
                    &models,
                ),
                told(
                    MinimumFlag::EdgeVocab,
                    "vocabulary",
                    "V",
                    &of_side(&vocab, side),
                    all,
                    &codes,
                ),
            ]
        })
        .flatten()
        .collect()
}

fn of_side(all: &[Outside], side: Side) -> Vec<&Outside> {
    all.iter().filter(|outside| outside.side == side).collect()
}

/// The sizes of a budget end before its expected optimum.
fn size_outside(tried: &Tried, expected: &Expected) -> Option<Outside> {
    let [first, .., last] = &tried.sizes[..] else { return None };
    let ends = [first.params_nonvocab, last.params_nonvocab];
    outside(tried, expected.params_nonvocab, ends, 1.0, expected.by)
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
    outside(tried, n_vocab, [first as f64, last as f64], expected.vocab_within, expected.by)
}

fn outside(
    tried: &Tried,
    expected: f64,
    [first, last]: [f64; 2],
    within: f64,
    by: &'static str,
) -> Option<Outside> {
    let (side, end) = if expected * within <= first {
        (Side::Below, first)
    } else if expected / within >= last {
        (Side::Above, last)
    } else {
        return None;
    };
    Some(Outside { side, budget_flops: tried.budget_flops, expected, end, by })
}

fn told(
    flag: MinimumFlag,
    noun: &str,
    symbol: &str,
    found: &[&Outside],
    all: usize,
    mend: &str,
) -> Option<Doubt> {
    // The one furthest out stands for all.
    let off = |outside: &Outside| (outside.expected / outside.end).ln().abs();
    let worst = found.iter().max_by(|a, b| off(a).total_cmp(&off(b)))?;
    let where_: Vec<f64> = found.iter().map(|outside| outside.budget_flops).collect();
    let Outside { side, budget_flops, expected, end, by } = worst;
    let most = if *side == Side::Below { "smallest" } else { "largest" };
    let there = if found.len() > 1 { format!(" at {budget_flops:e}") } else { String::new() };
    let what = format!(
        "by {by} the optimum lies at or beyond the {most} {noun} tried {}: {symbol} = {expected:.2e}{there}, \
         and {end:.2e} is the {most}",
        at(&where_, all)
    );
    Some(Doubt::flag(flag, what, mend, where_))
}
