//! What is known of some quantities, and what one more observation would tell.

use crate::laws::maths::stats::dot;

/// A normal belief: the covariance of the quantities.
#[derive(Clone, Debug)]
pub(super) struct Belief {
    covariance: Vec<Vec<f64>>,
}

impl Belief {
    pub fn new(covariance: Vec<Vec<f64>>) -> Self {
        Self { covariance }
    }

    /// Variance of the combination `row` of the quantities.
    pub fn variance(&self, row: &[f64]) -> f64 {
        dot(&self.with(row), row)
    }

    /// Covariance of the combination `row` with each of the quantities.
    fn with(&self, row: &[f64]) -> Vec<f64> {
        self.covariance.iter().map(|own| dot(own, row)).collect()
    }

    /// The belief after an observation of `row`, itself of variance `noise`.
    pub fn observe(&mut self, row: &[f64], noise: f64) {
        let with = self.with(row);
        let total = noise + dot(&with, row);
        for (own, a) in self.covariance.iter_mut().zip(&with) {
            own.iter_mut().zip(&with).for_each(|(own, b)| *own -= a * b / total);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn observations_give_the_variance_of_least_squares() {
        let mut belief = Belief::new(vec![vec![1e6, 0.0], vec![0.0, 1e6]]);
        let xs = [0.0, 1.0, 2.0, 4.0];
        let noise = 0.09;
        for x in xs {
            belief.observe(&[1.0, x], noise);
        }
        // σ² (1/n + (x − x̄)²/Sxx) at x = 6: n = 4, x̄ = 1.75, Sxx = 8.75.
        let expected = noise * (0.25 + 4.25f64.powi(2) / 8.75);
        let target = [1.0, 6.0];
        assert!((belief.variance(&target) / expected - 1.0).abs() < 1e-4);
    }
}
