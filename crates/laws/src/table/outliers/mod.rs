//! Drops doubtful rows, one stage at a time; each stage is a pure function of the points.

mod course;
mod suspects;
#[cfg(test)]
mod tests;

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use self::course::{by, params};
use super::{UnknownName, named};
use crate::laws::IsoFlopPoint;

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
    /// Runs whose loss misses the smooth course of the other sizes of their V, at their budget and the
    /// neighbouring ones.
    Spline,
}

/// The points after a stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Split {
    /// In the order given.
    pub kept: Vec<IsoFlopPoint>,
    /// In the order given, with the reason of each.
    pub dropped: Vec<(IsoFlopPoint, String)>,
    /// Sentences on runs of which some are bad, and it cannot be told which.
    pub doubts: Vec<String>,
}

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

    /// Drops what the stage objects to.
    pub fn split(self, points: Vec<IsoFlopPoint>) -> Split {
        let (verdicts, doubts) = match self {
            Self::Duplicates => (duplicates(&points), Vec::new()),
            Self::FewLevels => (of_budgets(&points, few_levels), Vec::new()),
            Self::OffCentre => (of_budgets(&points, off_centre), Vec::new()),
            Self::Spline => suspects::off_course(&points),
        };
        let mut split = Split { doubts, ..Split::default() };
        for (point, verdict) in points.into_iter().zip(verdicts) {
            match verdict {
                None => split.kept.push(point),
                Some(reason) => split.dropped.push((point, reason)),
            }
        }
        split
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
