//! What a prediction may choose from, and how it counts.

use super::{Shape, default_ladder};

/// The count of training FLOPs that a prediction is projected with, under one rule.
///
/// Under `6nd` the count depends on N_nv, N_v and D alone. The others also depend on a model's
/// shape, which this module knows nothing of: a caller hands their count in as a closure.
#[derive(Clone, Copy)]
pub struct FlopCount<'a> {
    /// `openai`, `6nd` or `exact`.
    pub rule: &'a str,
    /// Of N_nv, N_v and D; must grow with each.
    pub flops: &'a (dyn Fn(f64, f64, f64) -> f64 + Sync),
}

impl FlopCount<'static> {
    /// 6(N_nv + N_v)D (ScaMo Eq. 7).
    pub const SIX_ND: Self = Self { rule: "6nd", flops: &|n, v, d| 6.0 * (n + v) * d };
}

/// The options of [`predict`](super::predict).
#[derive(Clone, Copy)]
pub struct PredictOptions<'a> {
    /// Should count by the rule that the laws are written in; a warning says where it does not.
    pub flop_count: FlopCount<'a>,
    /// The shapes that can be built.
    pub shapes: &'a [Shape],
}

impl Default for PredictOptions<'static> {
    /// The rule `6nd` and the [`default_ladder`].
    fn default() -> Self {
        Self { flop_count: FlopCount::SIX_ND, shapes: default_ladder() }
    }
}
