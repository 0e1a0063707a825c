//! The learning rate over a run.

use crate::plan::RunSpec;

/// The rate of step `step` (from 0): linear warm-up, then half a cosine to the final share.
pub fn learning_rate(spec: &RunSpec, step: usize) -> f64 {
    if step < spec.warmup_steps {
        return spec.lr * (step + 1) as f64 / (spec.warmup_steps + 1) as f64;
    }
    let decaying = (spec.steps - spec.warmup_steps).max(1) as f64;
    let progress = (step - spec.warmup_steps) as f64 / decaying;
    let cosine = 0.5 * (1.0 + (std::f64::consts::PI * progress).cos());
    spec.lr * (spec.final_share + (1.0 - spec.final_share) * cosine)
}
