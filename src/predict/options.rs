//! What a prediction may choose from, and how it counts.

use super::{Codebook, FlopCount, Shape, SixNd, default_ladder, scamo_codebooks};

/// The options of [`predict`](super::predict).
#[derive(Clone, Copy)]
pub struct PredictOptions<'a> {
    /// Should count by the rule that the laws are written in; a warning says where it does not.
    pub flop_count: &'a dyn FlopCount,
    /// The shapes that can be built.
    pub shapes: &'a [Shape],
    /// The vocabularies that can be built.
    pub codebooks: &'a [Codebook],
}

impl Default for PredictOptions<'static> {
    /// The rule `6nd`, the [`default_ladder`] and [`scamo_codebooks`].
    fn default() -> Self {
        Self { flop_count: &SixNd, shapes: default_ladder(), codebooks: scamo_codebooks() }
    }
}
