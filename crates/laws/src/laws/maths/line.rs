//! [`Line`]: a straight line, and the one of least squares.

/// A weighted straight line y = `level` + `slope` · (x − `centre`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::laws) struct Line {
    pub centre: f64,
    pub level: f64,
    pub slope: f64,
}

impl Line {
    pub fn at(&self, x: f64) -> f64 {
        self.level + self.slope * (x - self.centre)
    }
}

/// The least-squares line around the weighted mean of x; none where x does not vary.
///
/// Both sums are taken of deviations from the means: the textbook Σxy − n x̄ȳ would lose, at
/// ln C ≈ 40, three of the digits that the exponents need.
pub(in crate::laws) fn least_squares_line(x: &[f64], y: &[f64], weights: &[f64]) -> Option<Line> {
    let total: f64 = weights.iter().sum();
    let mean = |v: &[f64]| v.iter().zip(weights).map(|(v, w)| v * w).sum::<f64>() / total;
    let (centre, level) = (mean(x), mean(y));
    let sum = |term: &dyn Fn(usize) -> f64| (0..x.len()).map(|i| weights[i] * term(i)).sum::<f64>();
    let variance = sum(&|i| (x[i] - centre).powi(2));
    let covariance = sum(&|i| (x[i] - centre) * (y[i] - level));
    let spread = 1e-9 * centre.abs().max(1.0);
    let varies = variance / total > spread * spread;
    varies.then(|| Line { centre, level, slope: covariance / variance })
}
