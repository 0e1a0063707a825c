//! A quadratic spline through points.

use crate::laws::maths::least_squares::least_squares;

const DEGREE: usize = 2;

/// A piecewise quadratic with a continuous slope, as a sum of B-splines.
pub(super) struct Spline {
    knots: Vec<f64>,
    coefficients: Vec<f64>,
}

impl Spline {
    /// The spline through at least three points of ascending x, with the knots of scipy's
    /// `interp1d(kind="quadratic")`: the middles between neighbours but for the first and the last
    /// middle. None where x does not ascend.
    pub fn through(x: &[f64], y: &[f64]) -> Option<Self> {
        let knots = knots(x)?;
        let rows: Vec<Vec<f64>> = x
            .iter()
            .map(|x| (0..y.len()).map(|i| basis(&knots, i, DEGREE, *x)).collect())
            .collect();
        let coefficients = least_squares(&rows, y)?.coefficients;
        Some(Self { knots, coefficients })
    }

    /// The spline at `x`, which must lie within its points.
    pub fn at(&self, x: f64) -> f64 {
        let terms = self.coefficients.iter().enumerate();
        terms.map(|(i, c)| c * basis(&self.knots, i, DEGREE, x)).sum()
    }
}

fn knots(x: &[f64]) -> Option<Vec<f64>> {
    let (first, last) = (*x.first()?, *x.last()?);
    let middles: Vec<f64> = x.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0).collect();
    let inner = middles.get(1..middles.len().checked_sub(1)?)?;
    Some([&[first; DEGREE + 1], inner, &[last; DEGREE + 1]].concat())
}

/// B-spline `i` at `x` by the recursion of Cox and de Boor; the last knot belongs to the piece
/// below it.
fn basis(knots: &[f64], i: usize, degree: usize, x: f64) -> f64 {
    let last = knots[knots.len() - 1];
    if degree == 0 {
        let closed = x == last && knots[i] < last && knots[i + 1] == last;
        return if closed || (knots[i] <= x && x < knots[i + 1]) { 1.0 } else { 0.0 };
    }
    let ramp = |from: f64, to: f64| if to == from { 0.0 } else { (x - from) / (to - from) };
    let rising = ramp(knots[i], knots[i + degree]);
    let falling = ramp(knots[i + degree + 1], knots[i + 1]);
    rising * basis(knots, i, degree - 1, x) + falling * basis(knots, i + 1, degree - 1, x)
}

#[cfg(test)]
mod tests {
    use super::*;

    const X: [f64; 6] = [1.0, 2.0, 2.5, 4.0, 7.0, 8.0];

    #[test]
    fn a_parabola_is_its_own_spline() {
        let parabola = |x: f64| 3.0 - 2.0 * x + 0.25 * x * x;
        let spline = Spline::through(&X, &X.map(parabola)).unwrap();
        for x in [1.0, 1.3, 2.2, 3.9, 5.5, 8.0] {
            assert!((spline.at(x) - parabola(x)).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn the_spline_goes_through_its_points() {
        let y = [1.0, -1.0, 2.0, 0.0, 5.0, 4.0];
        let spline = Spline::through(&X, &y).unwrap();
        assert!(X.iter().zip(y).all(|(x, y)| (spline.at(*x) - y).abs() < 1e-12));
    }

    #[test]
    fn repeated_places_have_no_spline() {
        assert!(Spline::through(&[1.0, 1.0, 1.0, 2.0], &[0.0, 1.0, 2.0, 3.0]).is_none());
        assert!(Spline::through(&[], &[]).is_none());
        assert!(Spline::through(&[1.0], &[1.0]).is_none());
    }
}
