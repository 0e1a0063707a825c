//! [`Line`]: a straight line through points, of least squares or of Huber's.

use super::engine::{Residuals, Row, minimise};

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

/// Steps until Huber's weights are taken as they are.
const MOST_REWEIGHTINGS: usize = 500;

/// Points with a weight each, and a line to be laid through them.
pub(in crate::laws) struct Points<'a> {
    x: &'a [f64],
    y: &'a [f64],
    weights: &'a [f64],
    /// The weighted mean of x.
    centre: f64,
    /// Residuals beyond it count linearly.
    far: f64,
}

impl<'a> Points<'a> {
    /// None where x does not vary.
    pub fn new(x: &'a [f64], y: &'a [f64], weights: &'a [f64]) -> Option<Self> {
        let total: f64 = weights.iter().sum();
        let centre = mean(x, weights);
        let terms = x.iter().zip(weights).map(|(x, weight)| weight * (x - centre).powi(2));
        let spread = 1e-9 * centre.abs().max(1.0);
        let varies = terms.sum::<f64>() / total > spread * spread;
        varies.then_some(Self { x, y, weights, centre, far: f64::INFINITY })
    }

    /// The line of least Σ w ρ, ρ(r) = r²/2 up to `far` and far (|r| − far/2) beyond, from `start`.
    pub fn huber_line(self, start: &Line, far: f64) -> Line {
        Self { far, ..self }.line(start.at(self.centre), start.slope, MOST_REWEIGHTINGS)
    }

    fn line(&self, level: f64, slope: f64, most_steps: usize) -> Line {
        let (values, _) = minimise(self, vec![level, slope], most_steps);
        Line { centre: self.centre, level: values[0], slope: values[1] }
    }

    /// Each point's x from the centre, its residual and its weight.
    fn residuals(&self, values: &[f64]) -> impl Iterator<Item = (f64, f64, f64)> {
        let (level, slope) = (values[0], values[1]);
        self.x.iter().zip(self.y).zip(self.weights).map(move |((x, y), weight)| {
            let x = x - self.centre;
            (x, y - level - slope * x, *weight)
        })
    }
}

/// Steps of reweighted least squares, which are Newton's where no residual is far.
impl Residuals<2> for Points<'_> {
    const FULL_STEPS: bool = true;

    fn sum(&self, values: &[f64]) -> f64 {
        let residuals = self.residuals(values).map(|(_, r, weight)| {
            let near = r.abs().min(self.far);
            weight * near * (2.0 * r.abs() - near)
        });
        residuals.sum()
    }

    fn each(&self, values: &[f64], take: &mut dyn FnMut(f64, &Row<2>)) {
        for (x, residual, weight) in self.residuals(values) {
            let root = (weight * (self.far / residual.abs()).min(1.0)).sqrt();
            take(root * residual, &[root, root * x]);
        }
    }
}

fn mean(values: &[f64], weights: &[f64]) -> f64 {
    let sum: f64 = values.iter().zip(weights).map(|(value, weight)| value * weight).sum();
    sum / weights.iter().sum::<f64>()
}

/// The least-squares line around the weighted mean of x; none where x does not vary.
///
/// One step from the flat line through the mean. Its sums are of deviations from the means: the
/// textbook Σxy − n x̄ȳ would lose, at ln C ≈ 40, three of the digits that the exponents need.
pub(in crate::laws) fn least_squares_line(x: &[f64], y: &[f64], weights: &[f64]) -> Option<Line> {
    Some(Points::new(x, y, weights)?.line(mean(y, weights), 0.0, 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_line_has_the_slope_of_the_closed_form(
            points in proptest::collection::vec((30.0..50.0f64, 10.0..30.0f64, 0.5..3.0f64), 2..9),
        ) {
            let x: Vec<f64> = points.iter().map(|p| p.0).collect();
            let y: Vec<f64> = points.iter().map(|p| p.1).collect();
            let weights: Vec<f64> = points.iter().map(|p| p.2).collect();
            let (x0, y0) = (mean(&x, &weights), mean(&y, &weights));
            let sum = |term: &dyn Fn(f64, f64) -> f64| -> f64 {
                points.iter().map(|(x, y, weight)| weight * term(x - x0, y - y0)).sum()
            };
            let slope = sum(&|x, y| x * y) / sum(&|x, _| x * x);
            let line = least_squares_line(&x, &y, &weights).unwrap();
            let scale = slope.abs().max(1.0);
            prop_assert!((line.slope - slope).abs() < 1e-12 * scale, "{line:?}, {slope}");
            prop_assert!((line.at(x0) - y0).abs() < 1e-12 * y0.max(scale));
        }
    }
}
