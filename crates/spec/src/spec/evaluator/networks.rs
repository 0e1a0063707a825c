//! [`NetworksSpec`]: which networks embed motions and captions.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::error::{KeyProblem, failed};

/// The networks of an evaluator, resolved: what is hashed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum NetworksSpec {
    MotionClip(MotionClipSpec),
    Matching(MatchingSpec),
}

/// The sizes of two transformers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionClipSpec {
    /// Channels of a row, in both towers.
    pub width: usize,
    /// Layers of each tower.
    pub layers: usize,
    pub heads: usize,
    /// Frames of a row.
    pub frames: usize,
}

/// The sizes of the matching networks, and how they learn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatchingSpec {
    /// Channels of the convolutions and of the GRUs over captions; those over motions have twice as
    /// many.
    pub width: usize,
    /// Distance that pairs which do not match are pushed to.
    pub margin: f64,
    pub mismatches: Mismatches,
    /// Share of the channels after a convolution that is left out in training.
    pub dropout: f64,
}

/// Which pairs of a batch are pushed apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Mismatches {
    /// Each motion and the caption of one other, as Guo et al. do.
    Shifted,
    /// Each motion and all captions but its own.
    #[default]
    All,
}

impl Default for MotionClipSpec {
    fn default() -> Self {
        Self { width: 128, layers: 2, heads: 4, frames: 4 }
    }
}

impl Default for MatchingSpec {
    fn default() -> Self {
        Self { width: 64, margin: 10.0, mismatches: Mismatches::default(), dropout: 0.2 }
    }
}

/// Frames that two halvings of the rate make one.
const FRAMES_OF_TWO_HALVINGS: usize = 4;

impl NetworksSpec {
    /// Frames of a row.
    pub fn frames(&self) -> usize {
        match self {
            Self::MotionClip(sizes) => sizes.frames,
            Self::Matching(_) => FRAMES_OF_TWO_HALVINGS,
        }
    }

    /// What no training can use.
    pub(super) fn problems(&self) -> Vec<KeyProblem> {
        match self {
            Self::MotionClip(sizes) => sizes.problems(),
            Self::Matching(sizes) => sizes.problems(),
        }
    }

    /// FLOPs of a row forward, of motions and captions alike.
    pub(super) fn flops_per_row(&self, rows: usize) -> f64 {
        match self {
            Self::MotionClip(MotionClipSpec { width, layers, .. }) => {
                let d = *width as f64;
                2.0 * *layers as f64 * (12.0 * d * d + 2.0 * rows as f64 * d)
            }
            // Two directions of three gates from input and state each, of twice the width.
            Self::Matching(MatchingSpec { width, .. }) => {
                let d = 2.0 * *width as f64;
                2.0 * 2.0 * 6.0 * d * d
            }
        }
    }

    /// Bytes that the backward pass keeps of a row.
    pub fn training_bytes_per_row(&self) -> f64 {
        4.0 * match self {
            Self::MotionClip(MotionClipSpec { width, layers, .. }) => {
                ROWS_KEPT * (layers * width) as f64
            }
            Self::Matching(MatchingSpec { width, .. }) => GATES_KEPT * (4 * width) as f64,
        }
    }
}

/// Rows of the width that a layer of a transformer keeps for the way back: measured at 64 to 512 clips
/// a step and widths 64 and 128.
const ROWS_KEPT: f64 = 13.0;

/// Rows of the states of both directions that a step of a GRU keeps for the way back, what fills up
/// shorter motions among them: measured at 64 to 512 clips a step.
const GATES_KEPT: f64 = 33.0;

impl MotionClipSpec {
    fn problems(&self) -> Vec<KeyProblem> {
        let Self { width, heads, layers, frames } = *self;
        let divides = heads > 0 && width > 0 && width.is_multiple_of(2 * heads);
        failed([
            (layers > 0, "layers", "must be at least 1"),
            (divides, "heads", "width / heads must be an even whole number: RoPE turns pairs"),
            (frames > 0, "frames", "must be at least 1"),
        ])
    }
}

impl MatchingSpec {
    fn problems(&self) -> Vec<KeyProblem> {
        failed([
            (self.width > 0, "width", "must be at least 1"),
            (self.margin > 0.0, "margin", "must be above 0"),
            ((0.0..1.0).contains(&self.dropout), "dropout", "lies in [0, 1)"),
        ])
    }
}
