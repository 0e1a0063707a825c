//! How well a tokenizer reconstructs, and how much of its codebook it uses.

use serde::{Deserialize, Serialize};

/// Reconstruction and codebook use over the whole test split: `tokenizers/<id>/metrics.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TokenizerMetrics {
    pub tokenizer_id: String,
    /// `fsq` or `vq`.
    pub kind: String,
    /// Codes (V).
    pub n_vocab: usize,
    /// FSQ levels; absent for VQ.
    pub levels: Option<Vec<usize>>,
    /// Mean absolute error of normalised features.
    pub reconstruction_l1: f64,
    /// Mean per-joint position error, pelvis-aligned, in millimetres.
    pub mpjpe_mm: f64,
    /// Share of codes met in the test split.
    pub utilisation: f64,
    /// exp of the entropy of the code histogram of the test split: effective codes.
    pub exponential_entropy: f64,
    pub parameters: usize,
    pub train_steps: usize,
    pub wall_s: f64,
}
