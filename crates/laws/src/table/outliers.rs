//! Drops doubtful rows, one stage at a time; each stage is a pure function of the points.

use std::collections::BTreeSet;
use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::{UnknownName, named};
use crate::laws::{IsoFlopPoint, spline_at};

/// A rule that drops rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum OutlierStage {
    /// Runs of one budget, V and seed whose N agree within 1 %: the first in the table stays.
    Duplicates,
    /// Budgets with fewer than three distinct N.
    FewLevels,
    /// Budgets whose parabola of loss in ln N does not open upwards, or has its vertex outside the
    /// middle 80 % of the range of ln N.
    OffCentre,
    /// Runs whose loss misses Akima's spline through the other sizes of their budget and V.
    Spline,
}

/// Points dropped, with the reason of each.
type WithReasons = Vec<(IsoFlopPoint, String)>;
/// For each point the reason to drop it, or none.
type Verdicts = Vec<Option<String>>;

impl OutlierStage {
    /// Every stage with its name.
    pub const ALL: [(&'static str, Self); 4] = [
        ("duplicates", Self::Duplicates),
        ("few-levels", Self::FewLevels),
        ("off-centre", Self::OffCentre),
        ("spline", Self::Spline),
    ];

    /// The points kept, and those dropped with the reason of each, both in the order given.
    pub fn split(self, points: Vec<IsoFlopPoint>) -> (Vec<IsoFlopPoint>, WithReasons) {
        let verdicts = match self {
            Self::Duplicates => duplicates(&points),
            Self::FewLevels => of_budgets(&points, few_levels),
            Self::OffCentre => of_budgets(&points, off_centre),
            Self::Spline => off_spline(&points),
        };
        let (mut kept, mut dropped) = (Vec::new(), Vec::new());
        for (point, verdict) in points.into_iter().zip(verdicts) {
            match verdict {
                None => kept.push(point),
                Some(reason) => dropped.push((point, reason)),
            }
        }
        (kept, dropped)
    }
}

impl fmt::Display for OutlierStage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

impl FromStr for OutlierStage {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        named("stage of outliers", name, &Self::ALL)
    }
}

// Points by budget, by vocabulary and by size.

/// Relative distance within which two values are one but for rounding.
const SAME: f64 = 1e-9;

/// N = N_nv + N_v.
fn params(point: &IsoFlopPoint) -> f64 {
    point.params_nonvocab + point.params_vocab
}

/// Indices into `points` grouped by a value, ascending; each group in the given order.
fn by(
    points: &[IsoFlopPoint],
    indices: &[usize],
    value: impl Fn(&IsoFlopPoint) -> f64,
) -> Vec<Vec<usize>> {
    let of = |index: usize| value(&points[index]);
    let mut sorted = indices.to_vec();
    sorted.sort_by(|a, b| of(*a).total_cmp(&of(*b)));
    let same = |a: &usize, b: &usize| (of(*a) - of(*b)).abs() <= SAME * of(*b).abs();
    let mut groups: Vec<Vec<usize>> = sorted.chunk_by(same).map(<[usize]>::to_vec).collect();
    groups.iter_mut().for_each(|group| group.sort_unstable());
    groups
}

/// Indices of the points of each budget, ascending.
fn budgets(points: &[IsoFlopPoint]) -> Vec<Vec<usize>> {
    let all: Vec<usize> = (0..points.len()).collect();
    by(points, &all, |point| point.budget_flops)
}

/// Indices of the points of each budget and vocabulary, ascending.
fn vocabularies(points: &[IsoFlopPoint]) -> Vec<Vec<usize>> {
    let of = |budget: Vec<usize>| by(points, &budget, |point| point.n_vocab);
    budgets(points).into_iter().flat_map(of).collect()
}

/// All runs of a budget go for the reason that there is against it.
fn of_budgets(
    points: &[IsoFlopPoint],
    reason: fn(&[IsoFlopPoint], &[usize]) -> Option<String>,
) -> Verdicts {
    let mut verdicts = vec![None; points.len()];
    for budget in budgets(points) {
        let reason = reason(points, &budget);
        budget.iter().for_each(|run| verdicts[*run].clone_from(&reason));
    }
    verdicts
}

// The stages.

/// Sizes within this share of each other are one.
const SAME_SIZE: f64 = 0.01;

/// Drops a run if an earlier kept one has the same budget, V and seed, and N within 1 %.
///
/// Nearly equal sizes count twice in a parabola and distort a spline.
fn duplicates(points: &[IsoFlopPoint]) -> Verdicts {
    let mut verdicts = vec![None; points.len()];
    for runs in vocabularies(points) {
        let mut kept: Vec<usize> = Vec::new();
        for run in runs {
            let twin = |other: &&usize| {
                let (a, b) = (&points[run], &points[**other]);
                let apart = (params(a) - params(b)).abs();
                a.seed == b.seed && apart <= SAME_SIZE * params(a).max(params(b))
            };
            let Some(twin) = kept.iter().find(twin) else {
                kept.push(run);
                continue;
            };
            let id = &points[*twin].run_id;
            verdicts[run] = Some(format!("same budget, V and seed as {id}, and N within 1 %"));
        }
    }
    verdicts
}

/// A parabola needs three sizes.
const MIN_LEVELS: usize = 3;

/// Against a budget with fewer than three distinct N.
fn few_levels(points: &[IsoFlopPoint], runs: &[usize]) -> Option<String> {
    let (levels, flops) = (by(points, runs, params).len(), points[runs[0]].budget_flops);
    (levels < MIN_LEVELS)
        .then(|| format!("budget {flops:e} has {levels} distinct N, fewer than {MIN_LEVELS}"))
}

/// The share of the range of ln N, around its middle, that the vertex must lie in.
const MIDDLE: f64 = 0.8;

/// Against a budget whose parabola of loss in ln N does not open upwards, or has its vertex outside the
/// middle 80 % of the range of ln N. Fewer than three sizes are not judged.
fn off_centre(points: &[IsoFlopPoint], runs: &[usize]) -> Option<String> {
    if by(points, runs, params).len() < MIN_LEVELS {
        return None;
    }
    let ln_params: Vec<f64> = runs.iter().map(|run| params(&points[*run]).ln()).collect();
    let loss: Vec<f64> = runs.iter().map(|run| points[*run].loss).collect();
    let low = ln_params.iter().copied().fold(f64::INFINITY, f64::min);
    let high = ln_params.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let z: Vec<f64> = ln_params.iter().map(|x| (x - middle) / half).collect();
    let flops = points[runs[0]].budget_flops;
    let Some(vertex) = vertex(&z, &loss) else {
        return Some(format!("the parabola of budget {flops:e} does not open upwards"));
    };
    (vertex.abs() > MIDDLE).then(|| {
        let share = 50.0 * (vertex + 1.0);
        let n = (middle + half * vertex).exp();
        format!(
            "the vertex of budget {flops:e} lies at N = {n:.3e}, {share:.0} % of the way from the \
             smallest ln N tried to the largest"
        )
    })
}

/// The minimum of the least-squares parabola through the points; `None` if it has none.
///
/// It uses polynomials orthogonal over the points: 1, z − m, and z² minus its projections, so no system has to be
/// solved.
fn vertex(z: &[f64], y: &[f64]) -> Option<f64> {
    let n = z.len() as f64;
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mean = z.iter().sum::<f64>() / n;
    let linear: Vec<f64> = z.iter().map(|z| z - mean).collect();
    let squares: Vec<f64> = linear.iter().map(|x| x * x).collect();
    let (level, variance) = (squares.iter().sum::<f64>() / n, dot(&linear, &linear));
    let tilt = dot(&squares, &linear) / variance;
    let quadratic: Vec<f64> =
        squares.iter().zip(&linear).map(|(s, x)| s - level - tilt * x).collect();
    let curvature = dot(y, &quadratic) / dot(&quadratic, &quadratic);
    let slope = dot(y, &linear) / variance - curvature * tilt;
    let spread = y.iter().fold(0.0f64, |most, y| most.max(y.abs()));
    (curvature > 1e-12 * spread).then(|| mean - slope / (2.0 * curvature))
}

/// Scaled median misses that a run may miss by.
const MAX_DEVIATIONS: f64 = 5.0;
/// The MAD of a normal sample times this is its standard deviation.
const MAD_TO_SD: f64 = 1.4826;
/// Least sizes of a group: three besides the one judged.
const MIN_SIZES: usize = 4;
/// Knots on either side of a place that Akima's spline there depends on.
const REACH: usize = 3;
/// Misses below this share of the largest loss are rounding.
const ROUNDING: f64 = 1e-9;

/// Drops runs that lie off the smooth curve of their neighbours.
///
/// A run's residual is its loss minus Akima's spline in ln N through the other sizes of its budget and vocabulary. The
/// residuals of all groups give the scale: s is 1.4826 times the median of |residual|, and a run is dropped if
/// |residual| > 5 s. Deviations are from 0, not from the median residual: between convex neighbours every spline errs
/// to one side, and without noise that error is the scale.
///
/// An outlier bends the splines of its neighbours too, so only the worst run within reach is dropped at a time, and the
/// rest of the group is judged again. The smallest and the largest size, with a neighbour on one side only, and
/// groups of fewer than four sizes are not judged.
///
/// Akima, H. (1970), "A new method of interpolation and smooth curve fitting based on local
/// procedures", J. ACM 17(4).
fn off_spline(points: &[IsoFlopPoint]) -> Verdicts {
    let mut verdicts = vec![None; points.len()];
    let groups = vocabularies(points);
    let all = groups.iter().flat_map(|group| misses(points, group));
    let mut all: Vec<f64> = all.map(|miss| miss.by.abs()).collect();
    all.sort_by(f64::total_cmp);
    // The upper median of an even number.
    let median = all.get(all.len() / 2).copied().unwrap_or(0.0);
    let largest = points.iter().fold(0.0f64, |most, p| most.max(p.loss.abs()));
    let scale = (MAD_TO_SD * median).max(ROUNDING * largest);
    for mut group in groups {
        loop {
            let out = worst(misses(points, &group), MAX_DEVIATIONS * scale);
            if out.is_empty() {
                break;
            }
            group.retain(|run| out.iter().all(|miss| miss.run != *run));
            for Miss { run, by, .. } in out {
                let deviations = by.abs() / scale;
                verdicts[run] = Some(format!(
                    "misses its neighbours' spline by {by:.3}: {deviations:.1} times the usual"
                ));
            }
        }
    }
    verdicts
}

/// A run's loss less its neighbours' spline.
#[derive(Clone, Copy)]
struct Miss {
    run: usize,
    /// The index of its N in its group, ascending.
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
    let of_size = |i: usize| {
        let predicted = spline_at(&window(&x, i), &window(&y, i), x[i]);
        let miss =
            move |run: &usize| Miss { run: *run, size: i, by: points[*run].loss - predicted };
        sizes[i].iter().map(miss)
    };
    (1..sizes.len() - 1).flat_map(of_size).collect()
}

/// The knots without the `left_out` that the spline there depends on.
fn window(knots: &[f64], left_out: usize) -> Vec<f64> {
    let (first, last) = (left_out.saturating_sub(REACH), (left_out + REACH + 1).min(knots.len()));
    [&knots[first..left_out], &knots[left_out + 1..last]].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vertex_of_an_exact_parabola_is_found() {
        let z = [-1.0, -0.7, 0.1, 0.3, 1.0];
        let y = z.map(|z: f64| 2.0 + 0.3 * (z - 0.45).powi(2));
        assert!((vertex(&z, &y).unwrap() - 0.45).abs() < 1e-13);
        assert_eq!(vertex(&z, &z), None);
        assert_eq!(vertex(&z, &y.map(|y| -y)), None);
    }
}
