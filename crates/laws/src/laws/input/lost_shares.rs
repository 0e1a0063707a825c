//! Budgets whose runs all saw smaller shares of the data.

use super::budget::{Budget, is_same_budget};
use super::point::IsoFlopPoint;
use crate::laws::maths::stats::distinct;

/// The budgets that are left out since no run of theirs saw as much of the data as others.
pub(in crate::laws) fn lost_shares(points: &[IsoFlopPoint], budgets: &[Budget]) -> Vec<f64> {
    let known = |c: f64| budgets.iter().any(|own| is_same_budget(own.budget_flops, c));
    distinct(points.iter().map(|p| p.budget_flops).filter(|c| !known(*c)))
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
        let lost = |points: &[IsoFlopPoint]| lost_shares(points, &group_budgets(points).unwrap());
        assert_eq!(lost_shares(&points, &group_budgets(&points).unwrap()), [2e9]);
        assert!(lost(&points[..2]).is_empty());
    }
}
