//! [`EvaluatorSection`]: the `evaluator` section of a sweep file, and what follows from it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::networks::{MatchingSpec, Mismatches, MotionClipSpec, NetworksSpec};
use crate::spec::error::{KeyProblem, failed};
use crate::spec::representation::Representation;
use crate::units::{or_default, section};

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
    ($($(#[$about:meta])* $key:ident: $type:ty = $default:expr;)*) => {
        section! {
            /// The `evaluator` section: networks of motions and of captions, whose vectors are near each
            /// other where they belong together.
            ///
            /// The defaults train in a minute or two on a core.
            pub struct EvaluatorSection {
                /// Which networks they are.
                kind: EvaluatorKind = EvaluatorKind::default();
                /// Channels of a row in both towers (128); for `kind: matching`, of the convolutions and of
                /// the GRUs over captions (64), which is half of those over motions.
                width: Option<usize> = None, unless "Option::is_none";
                /// `kind: motionclip`: layers of each tower (2).
                layers: Option<usize> = None, unless "Option::is_none";
                /// `kind: motionclip`: heads of attention (4).
                heads: Option<usize> = None, unless "Option::is_none";
                /// `kind: motionclip`: frames of a row (4).
                frames: Option<usize> = None, unless "Option::is_none";
                /// `kind: matching`: the distance that pairs which do not match are pushed to (10).
                margin: Option<f64> = None, unless "Option::is_none";
                /// `kind: matching`: which pairs are pushed apart (`all`).
                mismatches: Option<Mismatches> = None, unless "Option::is_none";
                /// `kind: matching`: share of the channels after a convolution that is left out in training
                /// (0.2).
                dropout: Option<f64> = None, unless "Option::is_none";
                /// Features of a frame that it sees.
                representation: Representation = Representation::Meng67;
                /// The highest learning rate: 5e-4, for `kind: matching` 2e-3.
                lr: Option<f64> = None, unless "Option::is_none";
                $($(#[$about])* $key: $type = $default;)*
            }
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
    dim: usize = 64;
    /// Frames that are seen of a clip: a random window in training, else the first.
    window: usize = 196;
    /// Words are hashed n-grams of this width, whatever the text encoder of the runs.
    word_dim: usize = 128;
    /// Words that are seen of a caption.
    max_words: usize = 32;
    /// Share of the words of a caption that are left out in training.
    word_drop: f64 = 0.3;
    /// Clips of a step: each is told from others.
    batch: usize = 64;
    /// Steps of training.
    steps: usize = 800;
    /// Steps over which the learning rate rises; it falls along a cosine after them.
    warmup_steps: usize = 100;
    /// Decoupled, of AdamW.
    weight_decay: f64 = 0.1;
    /// How often it is measured on the validation split; the best of these is kept.
    evaluations: usize = 16;
    /// Training clips that are held in memory, at most.
    pool_clips: usize = 8192;
    /// Of weights, batches and windows.
    seed: u64 = 0;
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
                let own = or_default!(self, default, width, layers, heads, frames);
                NetworksSpec::MotionClip(own)
            }
            EvaluatorKind::Matching => {
                let default = MatchingSpec::default();
                let own = or_default!(self, default, width, margin, mismatches, dropout);
                NetworksSpec::Matching(own)
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
