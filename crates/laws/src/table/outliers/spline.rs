//! Runs that break the smooth course of their neighbours.
//!
//! A run's miss is its loss less Akima's spline in ln N through the other sizes of its budget and
//! vocabulary. Misses of all groups together give the scale: s is 1.4826 times the median of
//! |miss|, and a run is out where |miss| > 5 s. The deviation is taken from 0 and not from the
//! median miss: between convex neighbours every spline errs to one side, and where there is no
//! noise that error is the scale below which nothing can be said.
//!
//! An outlier bends the splines of its neighbours too, so only the worst run within reach goes at a
//! time, and the rest of the group is judged again. The smallest and the largest size have a
//! neighbour on one side only and are not judged, nor are groups of fewer than four sizes.
//!
//! Akima, H. (1970), "A new method of interpolation and smooth curve fitting based on local
//! procedures", J. ACM 17(4).

use std::collections::BTreeSet;

use super::group::{Verdicts, budgets, by, params};
use crate::laws::{IsoFlopPoint, spline_at};

/// Scaled median misses that a run may miss by.
const MAX_DEVIATIONS: f64 = 5.0;
/// The MAD of a normal sample times this is its standard deviation.
const MAD_TO_SD: f64 = 1.4826;
/// Sizes that a group needs: three beside the one judged.
const MIN_SIZES: usize = 4;
/// Knots on either side of a place that Akima's spline there depends on.
const REACH: usize = 3;
/// Misses below this share of the largest loss are rounding.
const ROUNDING: f64 = 1e-9;

/// Drops runs that miss the spline through their neighbours.
pub(super) fn verdicts(points: &[IsoFlopPoint]) -> Verdicts {
    let mut verdicts = vec![None; points.len()];
    let vocabularies = |budget: Vec<usize>| by(points, &budget, |point| point.n_vocab);
    let groups: Vec<Vec<usize>> = budgets(points).into_iter().flat_map(vocabularies).collect();
    let all = groups.iter().flat_map(|group| misses(points, group));
    let largest = points.iter().fold(0.0f64, |most, p| most.max(p.loss.abs()));
    let scale = MAD_TO_SD * median(all.map(|miss| miss.by.abs()).collect());
    let scale = scale.max(ROUNDING * largest);
    for mut group in groups {
        loop {
            let out = worst(misses(points, &group), MAX_DEVIATIONS * scale);
            if out.is_empty() {
                break;
            }
            group.retain(|run| out.iter().all(|miss| miss.run != *run));
            for Miss { run, by, .. } in out {
                let deviations = by.abs() / scale;
                let reason = format!(
                    "misses its neighbours' spline by {by:.3}: {deviations:.1} times the usual"
                );
                verdicts[run] = Some(reason);
            }
        }
    }
    verdicts
}

/// A run's loss less its neighbours' spline.
#[derive(Clone, Copy)]
struct Miss {
    run: usize,
    /// The place of its N among those of its group, ascending.
    size: usize,
    by: f64,
}

/// The runs that miss by more than `limit`, the worst first, and none whose spline depends on one
/// that is worse.
fn worst(mut misses: Vec<Miss>, limit: f64) -> Vec<Miss> {
    misses.retain(|miss| miss.by.abs() > limit);
    misses.sort_by(|a, b| b.by.abs().total_cmp(&a.by.abs()));
    let mut taken = BTreeSet::new();
    misses.retain(|miss| {
        let near = miss.size.saturating_sub(REACH)..=miss.size + REACH;
        taken.range(near).next().is_none() && taken.insert(miss.size)
    });
    misses
}

/// The median, the upper one of an even number; 0 for none.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// The miss of every run of an inner size.
fn misses(points: &[IsoFlopPoint], group: &[usize]) -> Vec<Miss> {
    let sizes = by(points, group, params);
    if sizes.len() < MIN_SIZES {
        return Vec::new();
    }
    let knot = |size: &Vec<usize>| {
        let loss = size.iter().map(|run| points[*run].loss).sum::<f64>();
        (params(&points[size[0]]).ln(), loss / size.len() as f64)
    };
    let (x, y): (Vec<f64>, Vec<f64>) = sizes.iter().map(knot).unzip();
    (1..sizes.len() - 1)
        .flat_map(|i| {
            let predicted = spline_at(&window(&x, i), &window(&y, i), x[i]);
            let miss = move |run: &usize| points[*run].loss - predicted;
            sizes[i].iter().map(move |run| Miss { run: *run, size: i, by: miss(run) })
        })
        .collect()
}

/// The knots without the `left_out`, as far as the spline there depends on them.
fn window(knots: &[f64], left_out: usize) -> Vec<f64> {
    let (first, last) = (left_out.saturating_sub(REACH), (left_out + REACH + 1).min(knots.len()));
    [&knots[first..left_out], &knots[left_out + 1..last]].concat()
}

#[cfg(test)]
mod tests {
    use super::super::OutlierStage::Spline;
    use super::super::group::testing::parabola;
    use crate::laws::IsoFlopPoint;

    #[test]
    fn one_wild_run_is_dropped_and_its_neighbours_stay() {
        let mut points: Vec<IsoFlopPoint> =
            [1e18, 1e19, 1e20].iter().flat_map(|c| parabola(*c, 11, 5.3)).collect();
        let noise = [0.3, -0.8, 0.5, 1.0, -0.6, -0.2, 0.7];
        for (i, point) in points.iter_mut().enumerate() {
            point.loss += 0.002 * noise[i % 7];
        }
        points[16].loss += 0.2;
        let (kept, dropped) = Spline.split(points.clone());
        assert_eq!(kept.len(), 32);
        assert_eq!(dropped[0].0, points[16]);
        assert!(dropped[0].1.contains("by 0.195"), "{}", dropped[0].1);
    }

    #[test]
    fn the_ends_are_not_judged_and_a_smooth_curve_loses_nothing() {
        let mut points = parabola(1e18, 9, 4.0);
        assert!(Spline.split(points.clone()).1.is_empty());
        points[0].loss += 5.0;
        points[8].loss -= 5.0;
        let dropped = Spline.split(points).1;
        assert!(dropped.iter().all(|(point, _)| point.params_nonvocab != 1e6), "{dropped:?}");
    }
}
