//! [`EvaluatorSpec`]: the networks whose embeddings motions are scored by, and the `evaluator` section of a sweep
//! file ([`EvaluatorSection`]), which it follows from.

mod features;

use std::f64::consts::PI;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use features::EvaluatorFeatures;

use super::{KeyProblem, failed, out_of_range};
use crate::units::number::plain;
use crate::units::{or_default, section};

plain!(EvaluatorKind, Mismatches);

/// Raised when the same spec would train to other bits, or be measured by other gates.
pub const EVALUATOR_REVISION: u32 = 4;

/// The kind of networks, as in a sweep file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EvaluatorKind {
    /// Two small transformers, whose unit vectors are brought together by symmetric InfoNCE (MARDM's
    /// MotionCLIP, without its pretrained text). MARDM's has `width: 512, layers: 8, heads: 8, dim: 512`.
    #[default]
    MotionClip,
    /// Convolutions and bidirectional GRUs, whose vectors are pulled together, or pushed apart up to a
    /// margin (Guo et al. 2022), trained in one stage. Theirs has `width: 512, dim: 512, mismatches:
    /// shifted`.
    Matching,
}

/// The keys shared by all kinds, with their defaults, for the section and for the resolved form.
macro_rules! shared {
    ($(
        $(#[$about:meta])* $key:ident: $type:ty = $default:expr, $low:literal to $high:literal;
    )*) => {
        section! {
            /// The `evaluator` section: networks of motions and of captions, whose vectors are close for matching
            /// pairs.
            ///
            /// The defaults train in a minute or two on a core.
            pub struct EvaluatorSection {
                /// A folder with an evaluator that others trained, in place of the other keys:
                /// `experiments/convert_evaluator.py` makes it, of the weights behind published tables. From
                /// the working folder; ids hold its content instead.
                weights: Option<PathBuf> = None, unless "Option::is_none";
                /// The kind of networks.
                kind: EvaluatorKind = EvaluatorKind::default();
                /// Channels of a row in both towers (128); for `kind: matching`, of the convolutions and of
                /// the GRUs over captions (64), which is half of those over motions.
                width: Option<usize> = None, 2 to 8192, unless "Option::is_none";
                /// `kind: motionclip`: layers of each tower (2).
                layers: Option<usize> = None, 1 to 128, unless "Option::is_none";
                /// `kind: motionclip`: heads of attention (4).
                heads: Option<usize> = None, 1 to 128, unless "Option::is_none";
                /// `kind: motionclip`: frames of a row (4).
                frames: Option<usize> = None, 1 to 64, unless "Option::is_none";
                /// `kind: matching`: the distance that pairs which do not match are pushed to (10).
                margin: Option<f64> = None, 1e-6 to 1e6, unless "Option::is_none";
                /// `kind: matching`: which pairs are pushed apart (`all`).
                mismatches: Option<Mismatches> = None, unless "Option::is_none";
                /// `kind: matching`: share of the channels after a convolution that is left out in training
                /// (0.2).
                dropout: Option<f64> = None, 0 to 0.999, unless "Option::is_none";
                /// Features of a frame that it sees.
                representation: EvaluatorFeatures = EvaluatorFeatures::default();
                /// The highest learning rate: 5e-4, for `kind: matching` 2e-3.
                lr: Option<f64> = None, 1e-12 to 1e30, unless "Option::is_none";
                /// Share of the clips of a step that bring a corrupted copy, which is a wrong answer to
                /// their captions.
                corrupted: f64 = 0.5, 0 to 1;
                $($(#[$about])* $key: $type = $default, $low to $high;)*
            }
        }

        /// An evaluator, resolved for hashing.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct EvaluatorSpec {
            pub networks: NetworksSpec,
            pub representation: EvaluatorFeatures,
            pub lr: f64,
            /// Absent in files of evaluators that learned from true motions alone.
            #[serde(default)]
            pub corrupted: f64,
            /// Weights that others trained; keys of training mean nothing then. `None` if it is trained here.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            pub loaded: Option<LoadedSpec>,
            $($(#[$about])* pub $key: $type,)*
        }

        impl EvaluatorSection {
            /// The evaluator that it describes, if that is trained here.
            pub fn spec(&self) -> EvaluatorSpec {
                EvaluatorSpec {
                    networks: self.networks(),
                    representation: self.representation,
                    lr: self.lr.unwrap_or(match self.kind {
                        EvaluatorKind::MotionClip => 5e-4,
                        EvaluatorKind::Matching => 2e-3,
                    }),
                    corrupted: self.corrupted,
                    loaded: None,
                    $($key: self.$key,)*
                }
            }
        }
    };
}

shared! {
    /// Numbers of an embedding.
    dim: usize = 64, 1 to 65_536;
    /// Frames that are seen of a clip: a random window in training, else the first.
    window: usize = 196, 1 to 16_384;
    /// Words are hashed n-grams of this width, whatever the text encoder of the runs.
    word_dim: usize = 128, 1 to 65_536;
    /// Words that are seen of a caption.
    max_words: usize = 32, 1 to 16_384;
    /// Share of the words of a caption that are left out in training.
    word_drop: f64 = 0.3, 0 to 0.999;
    /// Clips per step, contrasted with each other.
    batch: usize = 64, 2 to 65_536;
    /// Steps of training.
    steps: usize = 800, 1 to 100_000_000;
    /// Steps over which the learning rate rises; it falls along a cosine after them.
    warmup_steps: usize = 100, 0 to 100_000_000;
    /// Decoupled, of AdamW.
    weight_decay: f64 = 0.1, 0 to 1e3;
    /// Number of evaluations on the validation split; the best weights are kept.
    evaluations: usize = 16, 1 to 100_000;
    /// Most training clips in memory.
    pool_clips: usize = 8192, 2 to 10_000_000;
    /// Seed of weights, batches and windows.
    seed: u64 = 0, 0 to 18_446_744_073_709_551_615u64;
}

impl EvaluatorSection {
    fn networks(&self) -> NetworksSpec {
        match self.kind {
            EvaluatorKind::MotionClip => {
                let own = MotionClipSpec::default();
                NetworksSpec::MotionClip(or_default!(self, own, width, layers, heads, frames))
            }
            EvaluatorKind::Matching => {
                let own = MatchingSpec::default();
                NetworksSpec::Matching(or_default!(self, own, width, margin, mismatches, dropout))
            }
        }
    }

    /// Problems that make every evaluator fail.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let clip = self.kind == EvaluatorKind::MotionClip;
        let mut found = failed(belonging! {
            self, "";
            clip, "belongs to `kind: motionclip`" => layers, heads, frames;
            !clip, "belongs to `kind: matching`" => margin, mismatches, dropout;
        });
        found.extend(self.spec().problems());
        let alone = Self { weights: None, ..self.clone() } == Self::default();
        let alone = self.weights.is_none() || alone;
        found.extend(failed([(
            alone,
            "weights",
            "are of an evaluator that is not trained here: take out its other keys",
        )]));
        found
    }
}

impl EvaluatorSpec {
    /// What no training can use.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let mut found = out_of_range::<EvaluatorSection>(self);
        found.extend(self.networks.problems());
        found.extend(failed(each! {
            self;
            |n| n >= self.frames(), "holds at least the frames of one row" => window;
            |n| n >= self.batch, "holds at least one `batch`" => pool_clips;
        }));
        found
    }

    /// Frames of a row.
    pub fn frames(&self) -> usize {
        self.networks.frames()
    }

    /// The rate of a step, counted from 0: a linear rise, then half a cosine to 0.
    pub fn learning_rate(&self, step: usize) -> f64 {
        if step < self.warmup_steps {
            return self.lr * (step + 1) as f64 / (self.warmup_steps + 1) as f64;
        }
        let (done, all) = (step - self.warmup_steps, self.steps.saturating_sub(self.warmup_steps));
        self.lr * 0.5 * (1.0 + (PI * done as f64 / all.max(1) as f64).cos())
    }

    /// Clips of a step that bring a corrupted copy.
    pub fn n_corrupted(&self) -> usize {
        (self.corrupted * self.batch as f64).round() as usize
    }

    /// FLOPs that training counts for; 0 if it is loaded.
    pub fn training_flops(&self) -> f64 {
        if self.loaded.is_some() {
            return 0.0;
        }
        let motion = self.window.div_ceil(self.frames().max(1));
        let all = (self.batch + self.n_corrupted()) * motion + self.batch * self.max_words;
        3.0 * (self.steps * all) as f64 * self.networks.flops_per_row(motion + self.max_words)
    }
}

/// An evaluator that others trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadedSpec {
    /// Its name in published tables, as its user says: `guo`, `mardm`.
    pub name: String,
    /// Blake3 hex digest of its files.
    pub digest: String,
}

// [`NetworksSpec`]: which networks embed motions and captions.

/// The networks of an evaluator, resolved for hashing.
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

/// The pairs of a batch that are pushed apart.
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

    /// Problems that make training fail.
    fn problems(&self) -> Vec<KeyProblem> {
        let mut found = out_of_range::<EvaluatorSection>(self);
        if let &Self::MotionClip(MotionClipSpec { width, heads, .. }) = self {
            let divides = width.is_multiple_of(heads.saturating_mul(2));
            let turned = "width / heads must be an even whole number: RoPE turns pairs";
            found.extend(failed([(divides, "heads", turned)]));
        }
        found
    }

    /// FLOPs of a row forward, of motions and captions alike.
    fn flops_per_row(&self, rows: usize) -> f64 {
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

/// State rows of both directions that a step of a GRU keeps for the backward pass, padding included: measured at 64
/// to 512 clips per step.
const GATES_KEPT: f64 = 33.0;

#[cfg(test)]
mod tests;
