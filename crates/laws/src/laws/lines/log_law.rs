//! The loss as a straight line in log10 C (ScaMo Eq. 14).

use super::types::LogLaw;
use crate::laws::maths::line::least_squares_line;
use crate::laws::maths::stats::{aic, r2};

/// L_u = s log10 C + i by least squares; none where C does not vary.
pub fn log_law(compute: &[f64], loss: &[f64]) -> Option<LogLaw> {
    let x: Vec<f64> = compute.iter().map(|c| c.log10()).collect();
    let weights = vec![1.0; x.len()];
    let line = least_squares_line(&x, loss, &weights)?;
    let fitted: Vec<f64> = x.iter().map(|x| line.at(*x)).collect();
    Some(LogLaw {
        slope_per_decade: line.slope,
        intercept: line.at(0.0),
        r2: r2(loss, &fitted, &weights),
        aic: aic(loss, &fitted, 2),
        n: x.len(),
        ..LogLaw::default()
    })
}

impl LogLaw {
    /// L_u at C, in nats.
    pub fn loss_at(&self, compute: f64) -> f64 {
        self.slope_per_decade * compute.log10() + self.intercept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_line_is_recovered_from_its_own_points() {
        let c = [1e14, 1e15, 1e16, 1e18];
        let law = log_law(&c, &c.map(|c: f64| -1.062 * c.log10() + 13.839)).unwrap();
        assert!((law.slope_per_decade + 1.062).abs() < 1e-12);
        assert!((law.intercept - 13.839).abs() < 1e-11);
        assert!((law.loss_at(1e18) + 5.277).abs() < 1e-12);
        assert!(law.r2 > 1.0 - 1e-12 && law.aic.is_finite());
    }
}
