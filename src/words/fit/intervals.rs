//! What the intervals hold, and what they do not.

use crate::laws::{IntervalPart, Judgement, Laws, NoiseSource, student_t95};

/// The part that is the scatter of runs.
const RUNS: &str = "runs";

/// What the intervals of the exponents hold: of laws of minima, each part of the interval of N_nv's exponent;
/// `None` without intervals.
pub(super) fn sentence(laws: &Laws) -> Option<String> {
    if laws.recommended_law().is_joint() {
        return of_joint(laws);
    }
    let of = laws.parameters.size();
    laws.power_laws.of(of)?.exponent_ci95?;
    let parts = laws.judgement.interval_parts.iter();
    let told: Vec<String> = parts.filter_map(|part| told(part, laws)).collect();
    let rest = rest(laws);
    (!told.is_empty())
        .then(|| format!("Intervals hold, for {of}'s exponent: {}{rest}.", told.join(", ")))
}

fn of_joint(laws: &Laws) -> Option<String> {
    let joint = laws.judgement.joint.as_ref().filter(|joint| !joint.bootstrap.is_empty())?;
    let parts = [
        Some(format!("the scatter of {} cells ({:.3})", joint.n, joint.residual_sd)),
        laws.judgement.tokenizer_noise.as_ref().map(|_| "tokenizers".to_string()),
        laws.judgement.test_noise.as_ref().map(|_| "the test split".to_string()),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    Some(format!("Intervals hold {}{}.", parts.join(", "), rest(laws)))
}

fn told(part: &IntervalPart, laws: &Laws) -> Option<String> {
    let [low, high] = part.exponent_nonvocab?;
    let by = match laws.noise.map(|noise| noise.source) {
        Some(NoiseSource::Surface { .. }) if part.part == RUNS => {
            " (by a surface, for want of seeds)"
        }
        _ => "",
    };
    Some(format!("{} ±{:.3}{by}", part.part, (high - low) / 2.0))
}

/// What no interval holds, and what all losses may move by.
fn rest(laws: &Laws) -> String {
    let missing = missing(laws).map_or(String::new(), |missing| format!("; not {missing}"));
    missing + &on_other_clips(laws).unwrap_or_default()
}

/// What no interval holds.
fn missing(laws: &Laws) -> Option<&'static str> {
    let Judgement { tokenizer_noise: tokenizers, test_noise: test, .. } = &laws.judgement;
    match (tokenizers, test) {
        (None, None) if !laws.from_sweep => Some("what the runs did not vary"),
        (Some(_), Some(_)) => None,
        (Some(_), None) => Some("the test split"),
        (None, Some(_)) => Some("the tokenizers, one a vocabulary"),
        (None, None) => Some("the test split and the tokenizers, one a vocabulary"),
    }
}

/// What all losses together may move by.
fn on_other_clips(laws: &Laws) -> Option<String> {
    let noise = laws.judgement.test_noise.as_ref()?;
    let half = student_t95(noise.blocks - 1) * noise.sd;
    Some(format!("; all losses ±{half:.2} on other clips"))
}
