//! Tokenizers side by side, and what a study should say aloud of them.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::{Continuity, TokenizerMetrics};

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
        + &courses(tokenizers)
}

/// A line a tokenizer and a data set of its union; empty if no continuity was measured.
fn courses(tokenizers: &[TokenizerMetrics]) -> String {
    let mut rows = Vec::new();
    for t in tokenizers {
        let whole = t.continuity.map(|continuity| (t.n_vocab.to_string(), t.name(), continuity));
        let of = |(name, own): (&String, &Continuity)| (String::new(), format!("- {name}"), *own);
        rows.extend(whole);
        rows.extend(t.continuity_by_source.iter().flatten().map(of));
    }
    if rows.is_empty() {
        return String::new();
    }
    let mut out = format!(
        "\n\n{:>6} {:<27} {:>9} {:>7} {:>8} {:>8} {:>8}\n",
        "V", "tokenizer", "boundary", "jerk", "root, %", "at end", "still"
    );
    for (n_vocab, name, own) in rows {
        let _ = writeln!(
            out,
            "{n_vocab:>6} {name:<27.27} {:>9} {:>7} {:>8} {:>8} {:>8}",
            two_decimals(own.boundary_step_ratio),
            two_decimals(own.jerk_ratio),
            percent(own.root_error),
            percent(own.root_end_error),
            own.still_clips
        );
    }
    out + MOVEMENT
}

/// The columns of movement in a sentence each.
pub const MOVEMENT: &str = "boundary: joint steps between codes over joint steps within codes; boundary and\n\
jerk are divided by the true motion's; root: distance from the true root, as a\n\
share of the path (median over clips that travel)";

/// A ratio on a screen and in a report.
pub fn two_decimals(ratio: Option<f64>) -> String {
    ratio.map_or_else(|| "-".to_string(), |ratio| format!("{ratio:.2}"))
}

/// A share in percent, without the sign.
pub fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "-".to_string(), |share| format!("{:.0}", 100.0 * share))
}

fn millimetres(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_string(), |value| format!("{value:.1}"))
}

/// Sentences on tokenizers that a vocabulary's size buys nothing with, and on those whose motion breaks.
pub fn remarks(tokenizers: &[TokenizerMetrics]) -> Vec<String> {
    let found = [beaten(tokenizers), no_fall(tokenizers), stutter(tokenizers), drift(tokenizers)];
    found.into_iter().flatten().collect()
}

/// Steps across the boundaries of codes over steps inside, above which motion is seen to stutter.
const STUTTER: f64 = 1.2;
/// Share of the path's length above which the place where a motion ends is wrong.
const DRIFT: f64 = 0.1;

/// On those whose joints jump at the boundaries of codes.
fn stutter(tokenizers: &[TokenizerMetrics]) -> Option<String> {
    let found = above(tokenizers, STUTTER, |own| own.boundary_step_ratio);
    let told = listed(found, |ratio| format!("{ratio:.1} times"))?;
    Some(format!(
        "the joints jump at the boundaries of codes, by more than inside a code and than the truth, at \
         {told}: reconstructed and generated motions stutter there (docs/tokenizers.md)"
    ))
}

/// On those whose root ends elsewhere.
fn drift(tokenizers: &[TokenizerMetrics]) -> Option<String> {
    let found = above(tokenizers, DRIFT, |own| own.root_end_error);
    let told = listed(found, |share| format!("{:.0} %", 100.0 * share))?;
    Some(format!(
        "reconstructed motions end far from the true place, in shares of the path's length, at {told}: \
         MPJPE does not see it, since it puts the pelvis on one point (docs/tokenizers.md)"
    ))
}

/// Vocabularies and values of the tokenizers whose value is above `limit`.
fn above(
    tokenizers: &[TokenizerMetrics],
    limit: f64,
    of: fn(&Continuity) -> Option<f64>,
) -> Vec<(usize, f64)> {
    let value = |t: &TokenizerMetrics| Some((t.n_vocab, of(t.continuity.as_ref()?)?));
    tokenizers.iter().filter_map(value).filter(|(_, value)| *value > limit).collect()
}

/// `V = 240 (3.7 times)`, one after another.
fn listed(found: Vec<(usize, f64)>, text: fn(f64) -> String) -> Option<String> {
    let told = found.iter().map(|(n_vocab, value)| format!("V = {n_vocab} ({})", text(*value)));
    (!found.is_empty()).then(|| told.collect::<Vec<_>>().join(", "))
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
    use crate::codes::Baseline;

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
            continuity: None,
            continuity_by_source: None,
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

    /// A tokenizer with these ratios of steps and shares of paths.
    fn moving(boundary_step_ratio: f64, root_end_error: f64) -> TokenizerMetrics {
        let continuity = Continuity {
            boundary_step_ratio: Some(boundary_step_ratio),
            jerk: 90.0,
            jerk_ratio: Some(1.5),
            root_error: Some(0.5 * root_end_error),
            root_end_error: Some(root_end_error),
            travelling_clips: 30,
            still_clips: 2,
        };
        TokenizerMetrics { continuity: Some(continuity), ..tokenizer(240, 85.0, 98.0) }
    }

    #[test]
    fn a_stutter_and_a_drift_are_told_with_their_numbers() {
        assert!(remarks(&[moving(1.19, 0.09), tokenizer(512, 84.0, 98.0)]).is_empty());
        let said = remarks(&[moving(3.71, 0.26)]);
        assert_eq!(said.len(), 2);
        assert!(said[0].contains("V = 240 (3.7 times)"), "{said:?}");
        assert!(said[1].contains("V = 240 (26 %)"), "{said:?}");
    }

    #[test]
    fn an_older_file_has_no_continuity_and_a_new_one_comes_back() {
        let mut old = serde_json::to_value(tokenizer(240, 85.0, 98.0)).unwrap();
        for key in ["continuity", "continuity_by_source"] {
            old.as_object_mut().unwrap().remove(key).unwrap();
        }
        let read: TokenizerMetrics = serde_json::from_value(old).unwrap();
        assert_eq!(read, tokenizer(240, 85.0, 98.0));
        let mut new = moving(1.0, 0.1);
        new.continuity_by_source = new.continuity.map(|own| [("a".to_string(), own)].into());
        let text = serde_json::to_string(&new).unwrap();
        assert_eq!(serde_json::from_str::<TokenizerMetrics>(&text).unwrap(), new);
    }

    #[test]
    fn the_table_fits_80_columns() {
        let mut of_union = moving(1.0, 0.1);
        let name = "data/a-set-with-a-name-of-many-letters".to_string();
        of_union.continuity_by_source = of_union.continuity.map(|own| [(name, own)].into());
        let text = table(&[tokenizer(64_000, 122.0, 98.0), of_union]);
        assert!(text.contains("- data/a-set-with") && text.contains("1.50"), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        assert!(text.contains(" 64000 patch vq") && text.contains("71.7"), "{text}");
    }
}
