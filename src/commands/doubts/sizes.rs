//! Sizes that are too few, too far apart or of different depth for a minimum between them.

use isoflop::laws::WIDEST_STEP;

use super::doubt::{Doubt, at};
use super::tried::{Size, Tried};

/// Pairs of sizes that are named, at most.
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
    let mend = "add models there, or look at what is dropped";
    Some(Doubt { kind: "few-levels", what, mend: mend.to_string(), budgets_flops })
}

/// The neighbouring sizes of which something holds, each pair once, and the budgets where it does.
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

/// The first pairs, and how many there are besides; `None` without any.
fn named(pairs: &[[Size; 2]], one: impl Fn([Size; 2]) -> String) -> Option<String> {
    let shown: Vec<String> = pairs.iter().take(SHOWN).map(|pair| one(*pair)).collect();
    let more = pairs.len().saturating_sub(SHOWN);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    (!shown.is_empty()).then(|| shown.join(", ") + &more)
}

fn name(size: Size) -> String {
    format!("L{} d{}", size.n_layer, size.d_model)
}
