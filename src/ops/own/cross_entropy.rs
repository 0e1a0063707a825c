//! Cross-entropy from logits, without a tensor of log-probabilities.

use super::lanes::{LANES, vectorised};
use super::maths::{exp, log_sum_exp};

vectorised! {
    /// ln Σ e^logit of each row of `logits` `[n, n_vocab]`.
    pub fn log_normalisers(logits: &[f32], n_vocab: usize) -> Vec<f64> {
        let mut normalisers = Vec::with_capacity(logits.len() / n_vocab);
        for row in logits.chunks_exact(n_vocab) {
            normalisers.push(log_sum_exp::<L>(row));
        }
        normalisers
    }
}

/// Negative log-likelihood of each row's target, given the rows' log-normalisers, in nats.
pub fn losses(logits: &[f32], targets: &[u32], normalisers: &[f64]) -> Vec<f64> {
    let n_vocab = logits.len() / targets.len();
    let rows = logits.chunks_exact(n_vocab).zip(targets).zip(normalisers);
    rows.map(|((row, &target), normaliser)| normaliser - f64::from(row[target as usize])).collect()
}

vectorised! {
    /// Turns logits into the gradient by them of `scale` times the sum of the rows' losses.
    pub fn backward(logits: &mut [f32], targets: &[u32], normalisers: &[f64], scale: f32) {
        let n_vocab = logits.len() / targets.len();
        let rows = logits.chunks_exact_mut(n_vocab).zip(targets).zip(normalisers);
        for ((row, &target), &normaliser) in rows {
            let normaliser = L::splat(normaliser as f32);
            for x in row.chunks_mut(LANES) {
                exp(L::read(x).sub(normaliser)).mul(L::splat(scale)).write(x);
            }
            row[target as usize] -= scale;
        }
    }
}
