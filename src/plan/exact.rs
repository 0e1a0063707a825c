//! What a supervised token costs by the exact count, on clips of their own lengths.
//!
//! A step takes so many supervised tokens, and a clip that straddles two steps goes through the network in
//! both. So the price of a token hangs on how long clips are beside a step.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::spec::{ClipShape, Grid, Pricing};

/// Forward FLOPs a supervised token, on the mean over the clips and over where steps part them.
pub fn exact_per_token(
    generator: &dyn Pricing,
    codes: &Grid,
    clips: &BTreeMap<ClipShape, f64>,
    batch_tokens: usize,
) -> f64 {
    let (mut flops, mut tokens) = (0.0, 0.0);
    for (clip, count) in clips {
        let places = generator.places(codes, clip.n_frames);
        let step = (batch_tokens / places.tokens_each).max(1);
        let of_part = |part| generator.exact_of_part(codes, *clip, part);
        flops += count * over_steps(places.count, step, of_part);
        tokens += count * (places.count * places.tokens_each) as f64;
    }
    flops / tokens
}

/// The sum over the parts that steps of `step` places make of a clip of `n`, on the mean over where in a step
/// it begins.
fn over_steps(n: usize, step: usize, of_part: impl Fn(Range<usize>) -> f64) -> f64 {
    let whole = step.saturating_add(1).saturating_sub(n) as f64;
    let parted = |first: usize| {
        let later = (first..n).step_by(step).map(|from| of_part(from..(from + step).min(n)));
        of_part(0..first) + later.sum::<f64>()
    };
    let parted: f64 = (1..=step.min(n - 1)).map(parted).sum();
    (whole * of_part(0..n) + parted) / step as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same by laying clips of `n` into steps one after another.
    fn laid_out(n: usize, step: usize, of_part: impl Fn(Range<usize>) -> f64) -> f64 {
        // After `step` clips steps and clips begin together again.
        let mut sum = 0.0;
        for clip in 0..step {
            let (start, end) = (clip * n, (clip + 1) * n);
            let mut at = start;
            while at < end {
                let to = ((at / step + 1) * step).min(end);
                sum += of_part(at - start..to - start);
                at = to;
            }
        }
        sum / step as f64
    }

    #[test]
    fn clips_are_parted_as_a_stream_of_them_is() {
        let of_part = |part: Range<usize>| 10.0 + (part.end * part.end) as f64 + part.len() as f64;
        // Clips and steps without a common divisor begin at every offset.
        for (n, step) in [(5, 32), (37, 32), (49, 8), (3, 1), (1, 7)] {
            let (found, expected) = (over_steps(n, step, of_part), laid_out(n, step, of_part));
            assert!(
                (found / expected - 1.0).abs() < 1e-12,
                "{n} in steps of {step}: {found}, {expected}"
            );
        }
    }
}
