//! How well a tokenizer reconstructs, and how much of its codebook it uses.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::CodeHistogram;

/// Reconstruction and codebook use over the whole test split: `tokenizers/<id>/metrics.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TokenizerMetrics {
    pub tokenizer_id: String,
    /// `convolutional` or `patch`.
    pub architecture: Option<String>,
    /// The quantizer: `fsq`, `vq`, `residual` or `multiscale`.
    pub kind: String,
    /// Codes of all codebooks together (V).
    pub n_vocab: usize,
    /// FSQ levels; absent for VQ.
    pub levels: Option<Vec<usize>>,
    /// Mean absolute error of normalised features.
    pub reconstruction_l1: f64,
    /// Mean per-joint position error, pelvis-aligned, in millimetres.
    pub mpjpe_mm: f64,
    /// The same with the true heading instead of the tokenizer's own.
    pub mpjpe_heading_mm: Option<f64>,
    /// `mpjpe_mm` on the validation split, by which tokenizers are chosen.
    pub val_mpjpe_mm: Option<f64>,
    /// `mpjpe_heading_mm` on the validation split.
    pub val_mpjpe_heading_mm: Option<f64>,
    /// Share of codes met in the test split, of all codebooks together.
    pub utilisation: f64,
    /// exp of the entropy of the code histogram of the test split: effective codes. Several codebooks share one histogram
    /// with separate codes.
    pub exponential_entropy: f64,
    pub parameters: usize,
    /// The step of the kept weights.
    pub train_steps: usize,
    pub wall_s: f64,
    /// The use of each scale's own codebook.
    pub scales: Option<Vec<ScaleUse>>,
    /// Frames per code; `None` if that depends on the clip.
    pub frames_per_code: Option<usize>,
    /// Seed of its weights, clips and windows.
    pub seed: Option<u64>,
    /// How the reconstruction of the test split moves; `None` in files of older versions.
    pub continuity: Option<Continuity>,
    /// The same of each data set of a union, by its name; `None` for a single data set.
    pub continuity_by_source: Option<BTreeMap<String, Continuity>>,
    /// k-means with as many codes on the same split; its keys are absent where it was not measured.
    #[serde(flatten)]
    pub k_means: Option<Baseline>,
}

/// How a reconstruction moves from frame to frame, beside the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Continuity {
    /// Mean step of the joints across the boundaries of codes over the mean step inside codes, each first
    /// divided by the truth's: 1 if a boundary cannot be seen. A boundary lies after each latent's frames,
    /// for tokenizers without a code for each latent too. `None` if a latent stands for one frame.
    pub boundary_step_ratio: Option<f64>,
    /// Mean size of the third derivative of the joints' places, in m/s³.
    pub jerk: f64,
    /// The same over the truth's.
    pub jerk_ratio: Option<f64>,
    /// Distance on the ground from the root to the true root, mean over time, as a share of the length of
    /// the true root's path: the median over the clips that travel.
    pub root_error: Option<f64>,
    /// The same in the last frame.
    pub root_end_error: Option<f64>,
    /// Clips whose path counts.
    pub travelling_clips: usize,
    /// Clips that the root's errors leave out: their root travels less than 1 m.
    pub still_clips: usize,
}

/// How much of one codebook the test split uses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScaleUse {
    pub n_vocab: usize,
    pub utilisation: f64,
    pub exponential_entropy: f64,
}

impl ScaleUse {
    /// That of a histogram.
    pub fn of(histogram: &CodeHistogram) -> Self {
        Self {
            n_vocab: histogram.counts().len(),
            utilisation: histogram.utilisation(),
            exponential_entropy: histogram.exponential_entropy(),
        }
    }
}

impl TokenizerMetrics {
    /// `patch vq`; `vq` if the architecture is unknown.
    pub fn name(&self) -> String {
        let words: Vec<&str> =
            self.architecture.iter().map(String::as_str).chain([&*self.kind]).collect();
        words.join(" ")
    }
}

/// The reconstruction of the test split by k-means.
///
/// Principal components of patches of four frames, with weights close to MPJPE and joints at their height above the
/// root; 15 rounds; a code decodes to its patch by least squares. The baseline of a residual quantizer is residual too:
/// as many codebooks of the same size, each for the residual of the previous ones, so both spend the same bits per
/// frame. A multi-scale quantizer spends a fixed number of bits per clip, so it has no such baseline.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Baseline {
    #[serde(rename = "kmeans_mpjpe_mm")]
    pub mpjpe_mm: f64,
    /// The same with the true heading.
    #[serde(rename = "kmeans_mpjpe_heading_mm")]
    pub mpjpe_heading_mm: f64,
}

/// The codes of a tokenizer on a split.
pub struct CodeMap {
    pub scales: Vec<ScaleCodes>,
    /// Share of the variance of the codes that were met that lies along each axis of the map.
    pub explained: [f64; 2],
}

/// The codes of one scale.
pub struct ScaleCodes {
    pub met: CodeHistogram,
    /// The embedding of each code along the first two principal components of all used codes of all scales, `[v]`.
    pub places: Vec<[f64; 2]>,
}

impl ScaleCodes {
    /// The place of each code that was met, and how often it was, in units of how often it would have
    /// been if all codes were alike.
    pub fn that_were_met(&self) -> impl Iterator<Item = ([f64; 2], f64)> {
        let counts = self.met.counts();
        let mean = counts.iter().sum::<u64>() as f64 / counts.len() as f64;
        let of = self.places.iter().zip(counts).filter(|(_, count)| **count > 0);
        of.map(move |(place, count)| (*place, *count as f64 / mean))
    }
}
