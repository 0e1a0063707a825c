//! Tokenizers side by side, and what a study should say aloud of them.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::metrics::TokenizerMetrics;

/// Millimetres by which MPJPE may rise with V by chance.
const NOISE_MM: f64 = 1.0;

/// A line a tokenizer, at most 80 columns wide, each beside k-means of as many codes.
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

/// On those that k-means is nearer than.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tokenizer::Baseline;

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
