//! Points by a value of theirs.

use crate::laws::IsoFlopPoint;

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
