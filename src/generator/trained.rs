//! What every kind of generator reads and gives.

use serde::{Deserialize, Serialize};

use super::sums::SplitLoss;
use crate::codes::TokenStore;
use crate::learn::weights::Sources;
use crate::text::TextStore;

/// What a run reads, mapped and shared with the runs beside it.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    pub tokens: &'a TokenStore,
    pub text: &'a TextStore,
    /// What turns codes into the inputs of scales, where the generator asks for it.
    pub scales: Option<&'a dyn ScaleInputs>,
}

/// A tokenizer, for generators that make codes scale after scale.
pub trait ScaleInputs {
    /// What such a generator is shown before each scale but the first, `[b, s, c]` row-major: the sum of
    /// what the scales before it add to the latents, at its own length. The codes are those of
    /// `n_clips` clips of `n_frames` frames, clip after clip, scale after scale; they may end after any
    /// scale, and give as many inputs as they have scales, as far as there are such.
    fn inputs(&self, codes: &[u32], n_clips: usize, n_frames: usize) -> Vec<Vec<f32>>;

    /// Latents of a clip of so many frames.
    fn n_latents(&self, n_frames: usize) -> usize;
}

/// A finished run.
pub struct Trained {
    pub weights: Sources,
    /// On the test split.
    pub test: SplitLoss,
    pub log: Vec<LogLine>,
    /// Training FLOPs by the exact count.
    pub flops_exact: f64,
    /// Seconds, those of earlier processes included.
    pub wall_s: f64,
}

/// A line of `log.jsonl`: a run measured on the validation split.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogLine {
    pub step: usize,
    /// Supervised tokens so far.
    pub tokens: usize,
    pub lr: f64,
    /// Mean cross-entropy of the steps since the last line, in nats.
    pub train_loss_nats: f64,
    /// L_u on the validation split.
    pub val_loss_normalised: f64,
}
