//! [`doubts`]: what will be in doubt of a sweep's minima, told before the hours are spent.

mod bracket;
mod doubt;
mod measure;
mod sizes;
mod tried;

use isoflop::plan::Plan;
use isoflop::sweep::Sweep;

pub use doubt::Doubt;
pub use measure::too_few;
use tried::tried;

/// What is in doubt of a plan, one of each kind for each generator at most. A sweep of one size makes no law, so
/// nothing of its grid is in doubt.
pub fn doubts(sweep: &Sweep, plan: &Plan) -> Vec<Doubt> {
    let generators = tried(plan);
    let is_study = generators.iter().flatten().any(|budget| budget.sizes.len() > 1);
    let mut found: Vec<Doubt> = Vec::new();
    if is_study {
        for budgets in &generators {
            let own = [sizes::doubts(budgets), bracket::doubts(budgets)].concat();
            // Generators that share their sizes share what is in doubt of them.
            found
                .extend(own.into_iter().filter(|doubt| !found.contains(doubt)).collect::<Vec<_>>());
        }
        found.extend(measure::one_budget(plan));
        found.extend(measure::one_seed(sweep, plan));
    }
    found.extend(measure::small_test(plan));
    found
}

#[cfg(test)]
mod tests;
