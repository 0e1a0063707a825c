//! What a prediction may choose from, and how it counts.

use super::{FlopCount, Shape, SixNd, default_ladder};

/// The options of [`predict`](super::predict).
#[derive(Clone, Copy)]
pub struct PredictOptions<'a> {
    /// Should count by the rule that the laws are written in; a warning says where it does not.
    pub flop_count: &'a dyn FlopCount,
    /// The shapes that can be built.
    pub shapes: &'a [Shape],
}

impl Default for PredictOptions<'static> {
    /// The rule `6nd` and the [`default_ladder`].
    fn default() -> Self {
        Self { flop_count: &SixNd, shapes: default_ladder() }
    }
}
