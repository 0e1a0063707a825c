//! Reconstruction and codebook use of tokenizers: metrics, comparison, and warnings.

use std::collections::BTreeMap;
use std::fmt::Write;

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
    /// k-means with as many codes on the same split; its keys are absent if it was not measured.
    #[serde(flatten)]
    pub k_means: Option<Baseline>,
}

/// The use of one codebook by the test split.
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

// Tokenizers side by side.

/// Millimetres by which MPJPE may rise with V by chance.
const NOISE_MM: f64 = 1.0;

/// One line per tokenizer, at most 80 columns wide, with k-means of as many codes.
pub fn table(tokenizers: &[TokenizerMetrics]) -> String {
    let mut out = format!(
        "{:>23} {:>15} {:>15} {:>24}\n{:>6} {:<16} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>8}\n",
        "",
        "validation, mm",
        "test, mm",
        "k-means on test, mm",
        "V",
        "tokenizer",
        "own",
        "given",
        "own",
        "given",
        "own",
        "given",
        "entropy"
    );
    for t in tokenizers {
        let _ = writeln!(
            out,
            "{:>6} {:<16.16} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>8.1}",
            t.n_vocab,
            t.name(),
            millimetres(t.val_mpjpe_mm),
            millimetres(t.val_mpjpe_heading_mm),
            millimetres(Some(t.mpjpe_mm)),
            millimetres(t.mpjpe_heading_mm),
            millimetres(t.k_means.map(|k_means| k_means.mpjpe_mm)),
            millimetres(t.k_means.map(|k_means| k_means.mpjpe_heading_mm)),
            t.exponential_entropy
        );
    }
    out + "MPJPE by the tokenizer's own heading and by the true one; entropy in codes"
}

fn millimetres(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_string(), |value| format!("{value:.1}"))
}

/// Sentences on tokenizers that a vocabulary's size buys nothing with.
pub fn remarks(tokenizers: &[TokenizerMetrics]) -> Vec<String> {
    [beaten(tokenizers), no_fall(tokenizers)].into_iter().flatten().collect()
}

/// A warning about tokenizers that are worse than k-means.
fn beaten(tokenizers: &[TokenizerMetrics]) -> Option<String> {
    let lost = tokenizers.iter().filter_map(|t| {
        let k_means = t.k_means.filter(|k_means| k_means.mpjpe_mm < t.mpjpe_mm)?;
        let (v, own, other) = (t.n_vocab, t.mpjpe_mm, k_means.mpjpe_mm);
        Some(format!("V = {v} ({own:.0} mm against {other:.0})"))
    });
    let lost: Vec<String> = lost.collect();
    (!lost.is_empty()).then(|| {
        format!(
            "the tokenizers lose to k-means of as many codes at {}: tokenizer.kind=patch with VQ beats \
             it on real motion (docs/tokenizers.md)",
            lost.join(", ")
        )
    })
}

/// On vocabularies, of one kind of tokenizer, whose reconstruction is no better than a smaller one's.
fn no_fall(tokenizers: &[TokenizerMetrics]) -> Option<String> {
    let mut errors: BTreeMap<(String, usize), Vec<f64>> = BTreeMap::new();
    for t in tokenizers {
        let error = t.mpjpe_heading_mm.unwrap_or(t.mpjpe_mm);
        errors.entry((t.name(), t.n_vocab)).or_default().push(error);
    }
    let mean = |errors: &Vec<f64>| errors.iter().sum::<f64>() / errors.len() as f64;
    let means: Vec<_> = errors.iter().map(|((name, v), errors)| (name, v, mean(errors))).collect();
    let rises = means.windows(2).filter_map(|pair| {
        let [(name, small, before), (other, large, after)] = [pair[0], pair[1]];
        let rises = name == other && after > before + NOISE_MM;
        rises.then(|| format!("{before:.0} mm at V = {small}, {after:.0} at {large}"))
    });
    let rises: Vec<String> = rises.collect();
    (!rises.is_empty()).then(|| {
        format!(
            "the error of the joints does not fall with V ({}): there a larger vocabulary buys \
             nothing but entropy",
            rises.join("; ")
        )
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    fn tokenizer(n_vocab: usize, mm: f64, k_means_mm: f64) -> TokenizerMetrics {
        TokenizerMetrics {
            tokenizer_id: String::new(),
            architecture: Some("patch".to_string()),
            kind: "vq".to_string(),
            n_vocab,
            levels: None,
            reconstruction_l1: 0.4,
            mpjpe_mm: mm,
            mpjpe_heading_mm: Some(mm - 5.0),
            val_mpjpe_mm: None,
            val_mpjpe_heading_mm: None,
            utilisation: 0.5,
            exponential_entropy: 71.66,
            parameters: 1,
            train_steps: 1,
            wall_s: 1.0,
            scales: None,
            frames_per_code: Some(4),
            seed: Some(0),
            k_means: Some(Baseline { mpjpe_mm: k_means_mm, mpjpe_heading_mm: 90.0 }),
        }
    }

    #[test]
    fn what_loses_to_k_means_and_what_does_not_fall_is_said() {
        let good = [tokenizer(1000, 85.0, 98.0), tokenizer(240, 87.0, 106.0)];
        assert!(remarks(&good).is_empty());
        let bad = [tokenizer(1000, 122.0, 98.0), tokenizer(240, 118.0, 130.0)];
        let said = remarks(&bad);
        assert!(said[0].contains("V = 1000 (122 mm against 98)"), "{said:?}");
        assert!(said[1].contains("113 mm at V = 240, 117 at 1000"), "{said:?}");
    }

    #[test]
    fn the_table_fits_80_columns() {
        let text = table(&[tokenizer(64_000, 122.0, 98.0)]);
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        assert!(text.contains(" 64000 patch vq") && text.contains("71.7"), "{text}");
    }
}
