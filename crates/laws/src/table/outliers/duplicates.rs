//! Runs made twice.

use super::group::{Verdicts, budgets, by, params};
use crate::laws::IsoFlopPoint;

/// Sizes within this share of each other are one.
const SAME_SIZE: f64 = 0.01;

/// Drops a run where an earlier one that stays has its budget, V and seed, and its N within 1 %.
///
/// Nearly equal sizes weigh twice in a parabola and tear a spline.
pub(super) fn verdicts(points: &[IsoFlopPoint]) -> Verdicts {
    let mut verdicts = vec![None; points.len()];
    for budget in budgets(points) {
        for vocab in by(points, &budget, |point| point.n_vocab) {
            among(points, &vocab, &mut verdicts);
        }
    }
    verdicts
}

fn among(points: &[IsoFlopPoint], runs: &[usize], verdicts: &mut Verdicts) {
    let mut kept: Vec<usize> = Vec::new();
    for run in runs {
        let twin = |other: &&usize| {
            let (a, b) = (&points[*run], &points[**other]);
            let apart = (params(a) - params(b)).abs();
            a.seed == b.seed && apart <= SAME_SIZE * params(a).max(params(b))
        };
        match kept.iter().find(twin) {
            None => kept.push(*run),
            Some(twin) => {
                let id = &points[*twin].run_id;
                verdicts[*run] = Some(format!("same budget, V and seed as {id}, and N within 1 %"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::OutlierStage::Duplicates;
    use super::super::group::testing::point;

    #[test]
    fn the_first_of_two_runs_within_one_per_cent_stays() {
        let points = vec![
            point(1e18, 1.009e6, 3.0),
            point(1e18, 1.0e6, 3.1),
            point(1e18, 2.0e6, 2.9),
            point(1e19, 1.0e6, 2.8),
        ];
        let (kept, dropped) = Duplicates.split(points.clone());
        assert_eq!(kept, [points[0].clone(), points[2].clone(), points[3].clone()]);
        assert_eq!(dropped[0].0, points[1]);
        assert!(dropped[0].1.contains("1e18 1.009e6"), "{}", dropped[0].1);
    }

    #[test]
    fn another_seed_or_vocabulary_is_no_duplicate() {
        let one = point(1e18, 1e6, 3.0);
        let points = vec![
            one.clone(),
            crate::laws::IsoFlopPoint { seed: 1, ..one.clone() },
            crate::laws::IsoFlopPoint { n_vocab: 64.0, ..one },
        ];
        assert!(Duplicates.split(points).1.is_empty());
    }
}
