//! Power laws by a straight line in logarithms (ScaMo Eqs. 9 and 10).

use super::robust;
use super::types::PowerLaw;
use crate::laws::maths::line::{Line, least_squares_line};
use crate::laws::maths::stats::r2;

/// The power law y = y(x0) (x/x0)^exponent through points, least squares in ln y, x0 being
/// `reference`.
///
/// `weights` is one positive number a point. With `huber`, its δ in units of the residuals' scaled
/// MAD, distant points count linearly; see [`crate::laws::input::options::FitOptions::huber`]. None where there are
/// fewer than two points or x does not vary. All values must be positive.
pub fn power_law(
    x: &[f64],
    y: &[f64],
    reference: f64,
    weights: &[f64],
    huber: Option<f64>,
) -> Option<PowerLaw> {
    let ln = |v: &[f64]| v.iter().map(|v| v.ln()).collect::<Vec<_>>();
    let (x, y) = (ln(x), ln(y));
    let line = match huber {
        Some(delta) => robust::huber_line(&x, &y, weights, delta)?,
        None => least_squares_line(&x, &y, weights)?,
    };
    Some(from_line(&line, &x, &y, reference, weights))
}

/// The law that a line in natural logarithms stands for.
pub(in crate::laws) fn from_line(
    line: &Line,
    ln_x: &[f64],
    ln_y: &[f64],
    reference: f64,
    weights: &[f64],
) -> PowerLaw {
    let fitted: Vec<f64> = ln_x.iter().map(|x| line.at(*x)).collect();
    PowerLaw {
        log10_coefficient: line.at(0.0) / std::f64::consts::LN_10,
        exponent: line.slope,
        ln_at_reference: line.at(reference.ln()),
        r2: r2(ln_y, &fitted, weights),
        n: ln_x.len(),
        ..PowerLaw::default()
    }
}

impl PowerLaw {
    /// y at x by the coefficient and the exponent alone.
    pub fn value_at(&self, x: f64) -> f64 {
        10f64.powf(self.log10_coefficient + self.exponent * x.log10())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn exact_points_give_back_the_law(
            exponent in -2.0..2.0f64,
            log10_coefficient in -6.0..6.0f64,
            start in 8.0..20.0f64,
            steps in proptest::collection::vec(0.1..1.5f64, 1..6),
            huber in proptest::option::of(0.1..3.0f64),
        ) {
            let log10_x: Vec<f64> = steps.iter().scan(start, |x, step| { *x += step; Some(*x) })
                .chain([start]).collect();
            let x: Vec<f64> = log10_x.iter().map(|x| 10f64.powf(*x)).collect();
            let y: Vec<f64> =
                log10_x.iter().map(|x| 10f64.powf(log10_coefficient + exponent * x)).collect();
            let law = power_law(&x, &y, 1e15, &vec![1.0; x.len()], huber).unwrap();
            prop_assert!((law.exponent - exponent).abs() < 1e-10);
            prop_assert!((law.log10_coefficient - log10_coefficient).abs() < 1e-9);
            let at_reference = (log10_coefficient + 15.0 * exponent) * std::f64::consts::LN_10;
            prop_assert!((law.ln_at_reference - at_reference).abs() < 1e-9);
            prop_assert!((law.value_at(x[0]) / y[0] - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn one_abscissa_gives_no_law() {
        assert_eq!(power_law(&[1e18, 1e18], &[1.0, 2.0], 1e18, &[1.0, 1.0], None), None);
        assert_eq!(power_law(&[1e18], &[1.0], 1e18, &[1.0], None), None);
        assert_eq!(power_law(&[], &[], 1e18, &[], Some(1.0)), None);
    }

    #[test]
    fn a_point_of_double_weight_counts_as_two() {
        let (x, y) = ([1e10, 1e11, 1e12], [2.0, 5.0, 9.0]);
        let weighted = power_law(&x, &y, 1e11, &[1.0, 1.0, 2.0], None).unwrap();
        let repeated =
            power_law(&[x[0], x[1], x[2], x[2]], &[y[0], y[1], y[2], y[2]], 1e11, &[1.0; 4], None)
                .unwrap();
        assert!((weighted.exponent - repeated.exponent).abs() < 1e-14);
        assert!((weighted.r2 - repeated.r2).abs() < 1e-14);
    }
}
