//! [`Doubt`]: a weakness of a plan.

use crate::commands::prelude::*;
use crate::commands::sizes::Expected;
use isoflop::laws::WIDEST_STEP;
use isoflop::plan::{Plan, PlannedRun};
use std::collections::BTreeSet;

/// A weakness of a plan, and its remedy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Doubt {
    /// The flag that a minimum would have, or a word for a doubt about the whole study.
    pub kind: &'static str,
    pub what: String,
    #[serde(rename = "do")]
    pub mend: String,
    /// The budgets concerned; empty if the doubt does not depend on the budget.
    pub budgets_flops: Vec<f64>,
}

impl Doubt {
    /// The doubt in a line: `gap: …; …`.
    pub fn sentence(&self) -> String {
        format!("{}: {}; {}", self.kind, self.what, self.mend)
    }
}

/// `at every budget`, `at 1e10 and 3e10 FLOPs`, `at 5 of 9 budgets`.
pub fn at(budgets: &[f64], all: usize) -> String {
    let written: Vec<String> = budgets.iter().map(|budget| format!("{budget:e}")).collect();
    match &written[..] {
        _ if budgets.len() == all && all > 1 => "at every budget".to_string(),
        [one] => format!("at {one} FLOPs"),
        [most @ .., last] if most.len() < 3 => format!("at {} and {last} FLOPs", most.join(", ")),
        _ => format!("at {} of {all} budgets", budgets.len()),
    }
}

// Sizes too few, too far apart or of different depth for a minimum between them.

/// Most pairs of sizes that are named.
const SHOWN: usize = 3;
/// Sizes that a parabola needs.
const FEWEST: usize = 3;

pub fn doubts(budgets: &[Tried]) -> Vec<Doubt> {
    [gaps(budgets), depth_changes(budgets), few(budgets)].into_iter().flatten().collect()
}

fn gaps(budgets: &[Tried]) -> Option<Doubt> {
    let step = |[left, right]: [Size; 2]| right.params_nonvocab / left.params_nonvocab;
    let (pairs, budgets_flops) = pairs(budgets, |pair| step(pair) > WIDEST_STEP);
    let named = named(&pairs, |pair| {
        format!("{} and {} ({:.1})", name(pair[0]), name(pair[1]), step(pair))
    })?;
    let what = format!(
        "neighbouring sizes are more than a factor {WIDEST_STEP} apart in N_nv {}: {named}",
        at(&budgets_flops, budgets.len())
    );
    let mend = "add a width between them, or a minimum that falls there is flagged";
    Some(Doubt { kind: "gap", what, mend: mend.to_string(), budgets_flops })
}

fn depth_changes(budgets: &[Tried]) -> Option<Doubt> {
    let (pairs, budgets_flops) = pairs(budgets, |[left, right]| left.n_layer != right.n_layer);
    let named = named(&pairs, |[left, right]| format!("{} and {}", name(left), name(right)))?;
    let what = format!(
        "neighbouring sizes differ in depth {}: {named}",
        at(&budgets_flops, budgets.len())
    );
    let mend = "list models of one n_layer (width_per_layer changes it), or a minimum that falls there \
                is flagged";
    Some(Doubt { kind: "depth-change", what, mend: mend.to_string(), budgets_flops })
}

fn few(budgets: &[Tried]) -> Option<Doubt> {
    let few = budgets.iter().filter(|budget| budget.sizes.len() < FEWEST);
    let budgets_flops: Vec<f64> = few.map(|budget| budget.budget_flops).collect();
    if budgets_flops.is_empty() {
        return None;
    }
    let what =
        format!("fewer than {FEWEST} sizes {}: no minimum", at(&budgets_flops, budgets.len()));
    let mend = "add models there, or check which cells are dropped";
    Some(Doubt { kind: "few-levels", what, mend: mend.to_string(), budgets_flops })
}

/// The neighbouring sizes with a property, each pair once, and the budgets where it holds.
fn pairs(budgets: &[Tried], holds: impl Fn([Size; 2]) -> bool) -> (Vec<[Size; 2]>, Vec<f64>) {
    let (mut pairs, mut budgets_flops) = (Vec::new(), Vec::new());
    for budget in budgets {
        let next = budget.sizes.windows(2).map(|pair| [pair[0], pair[1]]);
        let found: Vec<[Size; 2]> = next.filter(|pair| holds(*pair)).collect();
        if !found.is_empty() {
            budgets_flops.push(budget.budget_flops);
        }
        for pair in found {
            if !pairs.contains(&pair) {
                pairs.push(pair);
            }
        }
    }
    (pairs, budgets_flops)
}

/// The first pairs, and the number of further ones; `None` without any.
fn named(pairs: &[[Size; 2]], one: impl Fn([Size; 2]) -> String) -> Option<String> {
    let shown: Vec<String> = pairs.iter().take(SHOWN).map(|pair| one(*pair)).collect();
    let more = pairs.len().saturating_sub(SHOWN);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    (!shown.is_empty()).then(|| shown.join(", ") + &more)
}

fn name(size: Size) -> String {
    format!("L{} d{}", size.n_layer, size.d_model)
}

// [`Tried`]: the sizes and vocabularies of a plan at a budget.

/// A size of model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    pub params_nonvocab: f64,
    pub n_layer: usize,
    pub d_model: usize,
}

/// The sizes and vocabularies of a generator at a budget, ascending.
#[derive(Clone, Debug, PartialEq)]
pub struct Tried {
    pub budget_flops: f64,
    pub sizes: Vec<Size>,
    pub vocab: Vec<usize>,
    /// Whether the known laws apply to these runs: this program's tokenizer with one codebook, and autoregressive
    /// generation.
    pub has_law: bool,
}

/// The budgets of each generator.
pub fn tried(plan: &Plan) -> Vec<Vec<Tried>> {
    let mut runs: BTreeMap<&str, BTreeMap<u64, Vec<&PlannedRun>>> = BTreeMap::new();
    for run in &plan.runs {
        let of_generator = runs.entry(run.spec.generator.name()).or_default();
        // Budgets are above 0, so their bits are in their order.
        of_generator.entry(run.spec.budget_flops.to_bits()).or_default().push(run);
    }
    let of_budgets = |budgets: BTreeMap<u64, Vec<&PlannedRun>>| {
        budgets
            .into_iter()
            .map(|(bits, runs)| at_budget(f64::from_bits(bits), &runs, plan))
            .collect()
    };
    runs.into_values().map(of_budgets).collect()
}

fn at_budget(budget_flops: f64, runs: &[&PlannedRun], plan: &Plan) -> Tried {
    let size = |run: &&PlannedRun| {
        let (n, shape) = (run.params.nonvocab, run.spec.shape());
        let (n_layer, d_model) = (shape.n_layer, shape.d_model);
        (n, Size { params_nonvocab: n as f64, n_layer, d_model })
    };
    let sizes: BTreeMap<usize, Size> = runs.iter().map(size).collect();
    let vocab: BTreeSet<usize> = runs.iter().map(|run| run.spec.n_vocab()).collect();
    let is_known = |run: &&PlannedRun| {
        run.spec.generator.name() == "autoregressive" && run.spec.codes.scales.len() == 1
    };
    Tried {
        budget_flops,
        sizes: sizes.into_values().collect(),
        vocab: vocab.into_iter().collect(),
        has_law: !plan.tokenizers.is_empty() && runs.iter().all(is_known),
    }
}

// Budgets whose expected optimum lies outside the range tried.

/// An axis of the grid: the flag of a minimum at its end, noun, symbol, and remedy, with `{}` for smaller or
/// larger.
const SIZES: [&str; 4] = ["not-bracketed", "size", "N_nv", "add {} models there"];
const VOCABULARIES: [&str; 4] =
    ["edge-vocab", "vocabulary", "V", "add {} vocabularies, or the minima there are flagged"];

/// An expected optimum outside the range tried: its side, its place, and the end of the range.
struct Outside {
    is_below: bool,
    budget_flops: f64,
    expected: f64,
    end: f64,
    by: &'static str,
}

pub fn doubts_bracket(budgets: &[Tried]) -> Vec<Doubt> {
    let known = budgets.iter().filter(|budget| budget.has_law);
    let known: Vec<(&Tried, Expected)> =
        known.filter_map(|budget| Some((budget, Expected::of(budget.budget_flops)?))).collect();
    let mut doubts = Vec::new();
    for is_below in [true, false] {
        for axis in [SIZES, VOCABULARIES] {
            let outside = known.iter().filter_map(|(tried, law)| outside(tried, law, axis));
            let found: Vec<Outside> = outside.filter(|found| found.is_below == is_below).collect();
            doubts.extend(told(axis, &found, budgets.len()));
        }
    }
    doubts
}

/// An optimum beyond the sizes or vocabularies of a budget, within the uncertainty of the law. V follows from N_v at
/// the width of the size nearest to the optimum.
fn outside(tried: &Tried, law: &Expected, axis: [&str; 4]) -> Option<Outside> {
    let (expected, within, [first, last]) = if axis == SIZES {
        let [first, .., last] = &tried.sizes[..] else { return None };
        (law.params_nonvocab, 1.0, [first.params_nonvocab, last.params_nonvocab])
    } else {
        let [first, .., last] = tried.vocab[..] else { return None };
        let off = |size: &Size| (size.params_nonvocab / law.params_nonvocab).ln().abs();
        let nearest = tried.sizes.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
        let n_vocab = law.params_vocab / nearest.d_model as f64;
        (n_vocab, law.vocab_within, [first as f64, last as f64])
    };
    let is_below = expected * within <= first;
    let end = if is_below { first } else { last };
    let found = Outside { is_below, budget_flops: tried.budget_flops, expected, end, by: law.by };
    (is_below || expected / within >= last).then_some(found)
}

fn told(
    [kind, noun, symbol, mend]: [&'static str; 4],
    found: &[Outside],
    all: usize,
) -> Option<Doubt> {
    // The furthest one is reported.
    let off = |outside: &Outside| (outside.expected / outside.end).ln().abs();
    let worst = found.iter().max_by(|a, b| off(a).total_cmp(&off(b)))?;
    let budgets_flops: Vec<f64> = found.iter().map(|outside| outside.budget_flops).collect();
    let Outside { is_below, budget_flops, expected, end, by } = worst;
    let [most, more] = if *is_below { ["smallest", "smaller"] } else { ["largest", "larger"] };
    let there = if found.len() > 1 { format!(" at {budget_flops:e}") } else { String::new() };
    let what = format!(
        "by {by} the optimum lies at or beyond the {most} {noun} tried {}: {symbol} = {expected:.2e}{there}, \
         and {end:.2e} is the {most}",
        at(&budgets_flops, all)
    );
    Some(Doubt { kind, what, mend: mend.replace("{}", more), budgets_flops })
}
