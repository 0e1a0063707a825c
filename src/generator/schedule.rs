//! The learning rate over a run.

use std::f64::consts::PI;

use crate::plan::RunSpec;

/// The rate of step `step` (from 0): linear warm-up, then half a cosine to the final share, or the
/// peak up to the decay and 1 − √share over it (Hägele et al. 2024, "Scaling Laws and
/// Compute-Optimal Training Beyond Fixed Training Durations").
pub fn learning_rate(spec: &RunSpec, step: usize) -> f64 {
    if step < spec.warmup_steps {
        return spec.lr * (step + 1) as f64 / (spec.warmup_steps + 1) as f64;
    }
    let height = match spec.decay_steps {
        None => 0.5 * (1.0 + (PI * share(spec.warmup_steps, step, spec.steps)).cos()),
        Some(decay) => 1.0 - share(spec.steps - decay, step, spec.steps).sqrt(),
    };
    spec.lr * (spec.final_share + (1.0 - spec.final_share) * height)
}

/// How much of `from..to` is over at the beginning of a step; 0 before.
fn share(from: usize, step: usize, to: usize) -> f64 {
    step.saturating_sub(from) as f64 / (to - from).max(1) as f64
}
