//! [`EvaluatorSection`]: the `evaluator` section of a sweep file, and what follows from it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::networks::{MatchingSpec, Mismatches, MotionClipSpec, NetworksSpec, failed};
use crate::spec::error::KeyProblem;
use crate::spec::representation::Representation;
use crate::units::number;

/// Which networks, as it is written in a sweep file.
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

/// The keys that mean the same for every kind, each with its default: those of the section, and of what
/// follows from it.
macro_rules! shared {
    ($($(#[$about:meta])* $key:ident: $type:ty = $default:expr, $read:literal;)*) => {
        /// The `evaluator` section: networks of motions and of captions, whose vectors are near each
        /// other where they belong together.
        ///
        /// The defaults train in a minute or two on a core.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct EvaluatorSection {
            /// Which networks they are.
            pub kind: EvaluatorKind,
            /// Channels of a row in both towers (128); for `kind: matching`, of the convolutions and of
            /// the GRUs over captions (64), which is half of those over motions.
            #[serde(deserialize_with = "number::optional_count")]
            #[serde(skip_serializing_if = "Option::is_none")]
            pub width: Option<usize>,
            /// `kind: motionclip`: layers of each tower (2).
            #[serde(deserialize_with = "number::optional_count")]
            #[serde(skip_serializing_if = "Option::is_none")]
            pub layers: Option<usize>,
            /// `kind: motionclip`: heads of attention (4).
            #[serde(deserialize_with = "number::optional_count")]
            #[serde(skip_serializing_if = "Option::is_none")]
            pub heads: Option<usize>,
            /// `kind: motionclip`: frames of a row (4).
            #[serde(deserialize_with = "number::optional_count")]
            #[serde(skip_serializing_if = "Option::is_none")]
            pub frames: Option<usize>,
            /// `kind: matching`: the distance that pairs which do not match are pushed to (10).
            #[serde(deserialize_with = "number::optional_number")]
            #[serde(skip_serializing_if = "Option::is_none")]
            pub margin: Option<f64>,
            /// `kind: matching`: which pairs are pushed apart (`all`).
            #[serde(skip_serializing_if = "Option::is_none")]
            pub mismatches: Option<Mismatches>,
            /// `kind: matching`: share of the channels after a convolution that is left out in training
            /// (0.2).
            #[serde(deserialize_with = "number::optional_number")]
            #[serde(skip_serializing_if = "Option::is_none")]
            pub dropout: Option<f64>,
            /// Features of a frame that it sees.
            pub representation: Representation,
            /// The highest learning rate: 5e-4, for `kind: matching` 2e-3.
            #[serde(deserialize_with = "number::optional_number")]
            #[serde(skip_serializing_if = "Option::is_none")]
            pub lr: Option<f64>,
            $($(#[$about])* #[serde(deserialize_with = $read)] pub $key: $type,)*
        }

        /// An evaluator, resolved: what is hashed.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct EvaluatorSpec {
            pub networks: NetworksSpec,
            pub representation: Representation,
            pub lr: f64,
            $($(#[$about])* pub $key: $type,)*
        }

        impl Default for EvaluatorSection {
            fn default() -> Self {
                Self {
                    kind: EvaluatorKind::default(),
                    width: None,
                    layers: None,
                    heads: None,
                    frames: None,
                    margin: None,
                    mismatches: None,
                    dropout: None,
                    representation: Representation::Meng67,
                    lr: None,
                    $($key: $default,)*
                }
            }
        }

        impl EvaluatorSection {
            /// The evaluator that it describes.
            pub fn spec(&self) -> EvaluatorSpec {
                EvaluatorSpec {
                    networks: self.networks(),
                    representation: self.representation,
                    lr: self.lr.unwrap_or(self.kind.learning_rate()),
                    $($key: self.$key,)*
                }
            }
        }
    };
}

shared! {
    /// Numbers of an embedding.
    dim: usize = 64, "number::count";
    /// Frames that are seen of a clip: a random window in training, else the first.
    window: usize = 196, "number::count";
    /// Words are hashed n-grams of this width, whatever the text encoder of the runs.
    word_dim: usize = 128, "number::count";
    /// Words that are seen of a caption.
    max_words: usize = 32, "number::count";
    /// Share of the words of a caption that are left out in training.
    word_drop: f64 = 0.3, "number::number";
    /// Clips of a step: each is told from others.
    batch: usize = 64, "number::count";
    /// Steps of training.
    steps: usize = 800, "number::count";
    /// Steps over which the learning rate rises; it falls along a cosine after them.
    warmup_steps: usize = 100, "number::count";
    /// Decoupled, of AdamW.
    weight_decay: f64 = 0.1, "number::number";
    /// How often it is measured on the validation split; the best of these is kept.
    evaluations: usize = 16, "number::count";
    /// Training clips that are held in memory, at most.
    pool_clips: usize = 8192, "number::count";
    /// Of weights, batches and windows.
    seed: u64 = 0, "number::seed";
}

impl EvaluatorKind {
    fn learning_rate(self) -> f64 {
        match self {
            Self::MotionClip => 5e-4,
            Self::Matching => 2e-3,
        }
    }
}

impl EvaluatorSection {
    fn networks(&self) -> NetworksSpec {
        match self.kind {
            EvaluatorKind::MotionClip => {
                let default = MotionClipSpec::default();
                NetworksSpec::MotionClip(MotionClipSpec {
                    width: self.width.unwrap_or(default.width),
                    layers: self.layers.unwrap_or(default.layers),
                    heads: self.heads.unwrap_or(default.heads),
                    frames: self.frames.unwrap_or(default.frames),
                })
            }
            EvaluatorKind::Matching => {
                let default = MatchingSpec::default();
                NetworksSpec::Matching(MatchingSpec {
                    width: self.width.unwrap_or(default.width),
                    margin: self.margin.unwrap_or(default.margin),
                    mismatches: self.mismatches.unwrap_or_default(),
                    dropout: self.dropout.unwrap_or(default.dropout),
                })
            }
        }
    }

    /// What no evaluator can use.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let (clip, of_clip) =
            (self.kind == EvaluatorKind::MotionClip, "belongs to `kind: motionclip`");
        let (matching, of_matching) = (!clip, "belongs to `kind: matching`");
        let mut found = failed([
            (clip || self.layers.is_none(), "layers", of_clip),
            (clip || self.heads.is_none(), "heads", of_clip),
            (clip || self.frames.is_none(), "frames", of_clip),
            (matching || self.margin.is_none(), "margin", of_matching),
            (matching || self.mismatches.is_none(), "mismatches", of_matching),
            (matching || self.dropout.is_none(), "dropout", of_matching),
        ]);
        found.extend(self.spec().problems());
        found
    }
}
