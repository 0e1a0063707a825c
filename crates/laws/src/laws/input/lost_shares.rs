//! Budgets whose runs all saw smaller shares of the data.

use super::budget::{Budget, is_same_budget};
use super::point::IsoFlopPoint;
use crate::laws::maths::stats::distinct;
use crate::laws::words::text::count;

/// A sentence for the budgets that are left out since no run of theirs saw as much of the data as others.
pub(in crate::laws) fn of_lost_shares(
    points: &[IsoFlopPoint],
    budgets: &[Budget],
) -> Option<String> {
    let known = |c: f64| budgets.iter().any(|own| is_same_budget(own.budget_flops, c));
    let lost = distinct(points.iter().map(|p| p.budget_flops).filter(|c| !known(*c)));
    let named: Vec<String> = lost.iter().map(|budget| count(*budget)).collect();
    (!lost.is_empty()).then(|| {
        format!(
            "Runs at {} FLOPs saw smaller shares of the data alone, and are left out: train them on \
             the largest share too.",
            named.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::input::budget::group_budgets;
    use crate::laws::input::point::RunFacts;
    use crate::laws::simulated::point;

    #[test]
    fn budgets_of_smaller_shares_alone_are_named() {
        let on = |share, budget_flops| IsoFlopPoint {
            about: RunFacts { share: Some(share), ..RunFacts::default() },
            budget_flops,
            ..point(1e6, 1e4, -1.0, 0)
        };
        let points = [on(1.0, 1e9), on(0.5, 1e9), on(0.5, 2e9)];
        let budgets = group_budgets(&points).unwrap();
        let told = of_lost_shares(&points, &budgets).unwrap();
        assert!(told.starts_with("Runs at 2e9 FLOPs saw smaller shares"), "{told}");
        let budgets = group_budgets(&points[..2]).unwrap();
        assert_eq!(of_lost_shares(&points[..2], &budgets), None);
    }
}
