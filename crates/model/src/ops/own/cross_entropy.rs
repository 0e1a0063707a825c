//! Cross-entropy from blocks of logits, without a tensor of log-probabilities.

use std::ops::Range;

use super::lanes::{LANES, Lanes, vectorised};
use super::maths::{exp, max, sum_of_exp};

/// The softmax of a row as far as it has been seen.
#[derive(Clone, Copy, Debug)]
pub struct LogSum {
    /// The largest logit so far.
    largest: f32,
    /// Σ e^(logit − largest).
    sum: f64,
    /// The logit of the target, once seen.
    target: f32,
}

impl Default for LogSum {
    fn default() -> Self {
        Self { largest: f32::MIN, sum: 0.0, target: f32::NAN }
    }
}

impl LogSum {
    /// ln Σ e^logit.
    fn normaliser(&self) -> f64 {
        f64::from(self.largest) + self.sum.ln()
    }

    /// −ln p of the target, in nats.
    pub fn loss(&self) -> f64 {
        self.normaliser() - f64::from(self.target)
    }

    /// Takes the next logits of the row.
    #[inline(always)]
    fn add<L: Lanes>(&mut self, logits: &[f32]) {
        let largest = max::<L>(logits);
        if largest > self.largest {
            self.sum *= (f64::from(self.largest) - f64::from(largest)).exp();
            self.largest = largest;
        }
        self.sum += f64::from(sum_of_exp::<L>(logits, self.largest));
    }
}

vectorised! {
    /// Adds a block of columns, of as many rows as there are sums, with or without padding.
    pub fn add_block(
        logits: &[f32],
        columns: Range<usize>,
        targets: &[u32],
        sums: &mut [LogSum],
    ) {
        let stride = logits.len() / targets.len();
        let rows = logits.chunks_exact(stride).zip(targets).zip(sums);
        for ((row, &target), sum) in rows {
            let row = &row[..columns.len()];
            sum.add::<L>(row);
            let within = (target as usize).checked_sub(columns.start);
            if let Some(&logit) = within.and_then(|i| row.get(i)) {
                sum.target = logit;
            }
        }
    }
}

vectorised! {
    /// Turns such a block into the gradient by it of `scale` times the sum of the rows' losses.
    pub fn gradient_block(
        logits: &mut [f32],
        columns: Range<usize>,
        targets: &[u32],
        sums: &[LogSum],
        scale: f32,
    ) {
        let stride = logits.len() / targets.len();
        let rows = logits.chunks_exact_mut(stride).zip(targets).zip(sums);
        for ((row, &target), sum) in rows {
            let row = &mut row[..columns.len()];
            let normaliser = L::splat(sum.normaliser() as f32);
            for x in row.chunks_mut(LANES) {
                exp(L::read(x).sub(normaliser)).mul(L::splat(scale)).write(x);
            }
            let within = (target as usize).checked_sub(columns.start);
            if let Some(x) = within.and_then(|i| row.get_mut(i)) {
                *x -= scale;
            }
        }
    }
}
