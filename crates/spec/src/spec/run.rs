//! [`RunSpec`] and [`TokenizerJob`]: all that a worker needs to know, and the ids that follow.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{
    GeneratorSpec, Grid, ModelShape, ParamCounts, Precision, Share, TokenizerSpec, content_id,
};

/// The word that stands for the trainer in PyTorch that comes with isoflop; words behind it are its options.
const TORCH: &str = "torch";

/// Whether a command is that of the trainer in PyTorch that comes with isoflop.
pub fn is_torch(command: &str) -> bool {
    command.split_whitespace().next() == Some(TORCH)
}

/// Raised when the same spec would train to other bits: records of an older revision are stale.
pub const TRAINING_REVISION: u32 = 3;

/// One run, resolved: no rule is left to apply, no path and no time is in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunSpec {
    pub revision: u32,
    pub seed: u64,
    pub generator: GeneratorSpec,
    /// The codes that it learns to make.
    pub codes: Grid,
    pub budget_flops: f64,
    /// What it sees of the training split; left out where it is all of it.
    #[serde(default, skip_serializing_if = "Share::is_whole")]
    pub share: Share,
    pub batch_tokens: usize,
    pub steps: usize,
    pub lr: f64,
    pub warmup_steps: usize,
    /// The last learning rate as a share of the peak.
    pub final_share: f64,
    /// Steps of the decay at the end of a wsd schedule; `None` for a cosine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decay_steps: Option<usize>,
    /// Left out where it is `f32`.
    #[serde(default, skip_serializing_if = "crate::units::is_default")]
    pub precision: Precision,
    pub weight_decay: f64,
    pub betas: [f64; 2],
    pub epsilon: f64,
    /// `None` where gradients are not clipped.
    pub clip_norm: Option<f64>,
    /// Times a run that it is measured on the validation split.
    pub evaluations: usize,
    /// Frames per second of the data.
    pub fps: f64,
    pub data_digest: String,
    pub text_id: String,
    pub tokenizer_id: String,
    /// The program that trains it; `None` for the built-in trainer, whose ids know no such field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trainer: Option<TrainerProgram>,
    /// What it has of the keys that the sweep varies, as `train.lr=0.001`; ids of others know no such field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub varied: Option<String>,
}

/// What of a program of somebody's own its results follow from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainerProgram {
    pub command: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revision: Option<String>,
    /// Digests of the files that are named as its own; ids of others know no such field.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub inputs: BTreeMap<String, String>,
}

impl RunSpec {
    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }

    /// The steps before the decay, as a run of their own: what runs that differ in budget alone
    /// have in common. It has no budget, and is measured once, at its end. `None` for a cosine.
    pub fn trunk(&self) -> Option<Self> {
        let steps = self.steps - self.decay_steps?;
        let decay_steps = Some(0);
        let own = Self { steps, decay_steps, budget_flops: 0.0, ..self.clone() };
        Some(Self { evaluations: 1, final_share: 0.0, ..own })
    }

    /// Whether a user's program trains it, so that nothing measured of the built-in model holds for it: neither
    /// time nor memory.
    pub fn is_users_own(&self) -> bool {
        self.trainer.as_ref().is_some_and(|trainer| !is_torch(&trainer.command))
    }

    /// The generator's layers and widths.
    pub fn shape(&self) -> &ModelShape {
        self.generator.shape()
    }

    /// Codes (V).
    pub fn n_vocab(&self) -> usize {
        self.codes.n_vocab()
    }

    /// The generator's parameters by group.
    pub fn params(&self) -> ParamCounts {
        self.generator.params(&self.codes)
    }

    /// D: supervised motion tokens.
    pub fn tokens(&self) -> usize {
        self.steps * self.batch_tokens
    }

    /// Names the cell for a person: `L2 d32 V240 C=1e10 seed 0`, and its share where that is not all.
    pub fn label(&self) -> String {
        let ModelShape { n_layer, d_model, .. } = *self.shape();
        let (v, c, seed) = (self.n_vocab(), self.budget_flops, self.seed);
        let share = self.share.said();
        format!("L{n_layer} d{d_model} V{v} C={c:e}{share} seed {seed}")
    }
}

/// One tokenizer to train, on which every run with its vocabulary waits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TokenizerJob {
    pub revision: u32,
    pub spec: TokenizerSpec,
    pub data_digest: String,
    /// The captions that a tokenizer with language sees; ids of others know no such field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub text_id: Option<String>,
}

impl TokenizerJob {
    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }
}
