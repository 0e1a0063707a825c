//! Points by budget, by vocabulary and by size.

use crate::laws::IsoFlopPoint;

/// For each point the reason to drop it, or none.
pub(super) type Verdicts = Vec<Option<String>>;

/// Relative distance within which two values are one but for rounding.
const SAME: f64 = 1e-9;

/// N = N_nv + N_v.
pub(super) fn params(point: &IsoFlopPoint) -> f64 {
    point.params_nonvocab + point.params_vocab
}

/// Indices into `points` grouped by a value, ascending; those of each group in the order given.
pub(super) fn by(
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
pub(super) fn budgets(points: &[IsoFlopPoint]) -> Vec<Vec<usize>> {
    let all: Vec<usize> = (0..points.len()).collect();
    by(points, &all, |point| point.budget_flops)
}

#[cfg(test)]
pub(super) mod testing {
    use super::*;
    use crate::laws::{Metric, RunFacts};

    /// A point of a budget with one N and loss.
    pub fn point(budget_flops: f64, params_nonvocab: f64, loss: f64) -> IsoFlopPoint {
        IsoFlopPoint {
            run_id: format!("{budget_flops:e} {params_nonvocab:e}"),
            seed: 0,
            budget_flops,
            flops: budget_flops,
            params_nonvocab,
            params_vocab: 0.0,
            n_vocab: 0.0,
            tokens: budget_flops / 6.0 / params_nonvocab,
            metric: Metric::default(),
            loss,
            weight: 1.0,
            about: RunFacts::default(),
        }
    }

    /// Sizes from 1e6 to 1e6·2^(count − 1) on a parabola in ln N with its vertex at 1e6·2^vertex.
    pub fn parabola(budget_flops: f64, count: usize, vertex: f64) -> Vec<IsoFlopPoint> {
        let loss = |z: f64| 3.0 + 0.05 * (z - vertex).powi(2);
        let sizes = (0..count).map(|i| i as f64);
        sizes.map(|z| point(budget_flops, 1e6 * z.exp2(), loss(z))).collect()
    }
}
