//! Budgets with too few sizes for a curve.

use super::group::{Verdicts, budgets, by, params};
use crate::laws::IsoFlopPoint;

/// A parabola needs three sizes.
const MIN_LEVELS: usize = 3;

/// Drops the runs of budgets with fewer than three distinct N.
pub(super) fn verdicts(points: &[IsoFlopPoint]) -> Verdicts {
    let mut verdicts = vec![None; points.len()];
    for budget in budgets(points) {
        let levels = by(points, &budget, params).len();
        if levels < MIN_LEVELS {
            let flops = points[budget[0]].budget_flops;
            let reason =
                format!("budget {flops:e} has {levels} distinct N, fewer than {MIN_LEVELS}");
            budget.iter().for_each(|run| verdicts[*run] = Some(reason.clone()));
        }
    }
    verdicts
}

#[cfg(test)]
mod tests {
    use super::super::OutlierStage::FewLevels;
    use super::super::group::testing::{parabola, point};

    #[test]
    fn repeats_of_a_size_are_one_level() {
        let twice = vec![point(1e18, 1e6, 3.0), point(1e18, 2e6, 3.0), point(1e18, 2e6, 3.1)];
        let enough = parabola(1e19, 3, 1.0);
        let (kept, dropped) = FewLevels.split([twice, enough.clone()].concat());
        assert_eq!(kept, enough);
        assert_eq!(dropped.len(), 3);
        assert!(dropped[0].1.contains("1e18 has 2 distinct N"), "{}", dropped[0].1);
    }
}
