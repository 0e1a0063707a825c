//! The loss in C: a straight line in log10 C (ScaMo Eq. 14), and a power law with a floor, E + k (C/C0)^−g.

use crate::laws::maths::engine::least_squares_line;
use crate::laws::maths::stats::{aic, dot, interval95, r2};
use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::brent::BrentRoot;
use serde::{Deserialize, Serialize};

/// The two loss laws, always side by side.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LossLaws {
    pub log: Option<LogLaw>,
    pub floor: Option<FloorLaw>,
}

/// L_u = `slope_per_decade` · log10 C + `intercept` (ScaMo Eq. 14).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LogLaw {
    pub slope_per_decade: f64,
    pub intercept: f64,
    pub r2: f64,
    pub aic: f64,
    /// Predicted minus measured at the held-out budget, in nats.
    pub held_out_error: Option<f64>,
    pub slope_ci95: Option<[f64; 2]>,
    pub intercept_ci95: Option<[f64; 2]>,
    pub n: usize,
}

impl LogLaw {
    /// L_u at C, in nats.
    pub fn loss_at(&self, compute: f64) -> f64 {
        self.slope_per_decade * compute.log10() + self.intercept
    }

    /// R² and AIC, with more than two points.
    pub fn goodness(&self) -> Option<[f64; 2]> {
        (self.n > 2).then_some([self.r2, self.aic])
    }
}

/// L_u = `floor` + `coefficient` · (C / C0)^(−`exponent`), C0 = [`Laws::reference_flops`](crate::laws::Laws::reference_flops).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FloorLaw {
    pub floor: f64,
    pub coefficient: f64,
    pub exponent: f64,
    pub r2: f64,
    pub aic: f64,
    /// Predicted minus measured at the held-out budget, in nats.
    pub held_out_error: Option<f64>,
    pub floor_ci95: Option<[f64; 2]>,
    pub coefficient_ci95: Option<[f64; 2]>,
    pub exponent_ci95: Option<[f64; 2]>,
    pub n: usize,
}

impl FloorLaw {
    /// L_u at C, in nats; `reference` is the C0 the law was fitted around.
    pub fn loss_at(&self, compute: f64, reference: f64) -> f64 {
        self.sample().loss_at(compute, reference)
    }

    /// Whether the exponent stopped at an end of its range, so that the data show no floor.
    pub fn is_at_bound(&self) -> bool {
        EXPONENT_RANGE.contains(&self.exponent)
    }

    /// R² and AIC, with more than three points.
    pub fn goodness(&self) -> Option<[f64; 2]> {
        (self.n > 3).then_some([self.r2, self.aic])
    }

    /// The part that a replicate keeps.
    pub(super) fn sample(&self) -> FloorSample {
        FloorSample { floor: self.floor, coefficient: self.coefficient, exponent: self.exponent }
    }

    /// The law with the interval of each coefficient, over the replicates that had one.
    pub(in crate::laws) fn with_intervals(self, samples: &[FloorSample]) -> Self {
        let interval = |value: fn(&FloorSample) -> f64| interval95(samples.iter().map(value));
        Self {
            floor_ci95: interval(|s| s.floor),
            coefficient_ci95: interval(|s| s.coefficient),
            exponent_ci95: interval(|s| s.exponent),
            ..self
        }
    }
}

/// The floor law of one bootstrap replicate, around the C0 of the fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FloorSample {
    pub floor: f64,
    pub coefficient: f64,
    pub exponent: f64,
}

impl FloorSample {
    /// L_u at C, in nats; `reference` is C0.
    pub fn loss_at(&self, compute: f64, reference: f64) -> f64 {
        self.floor + self.coefficient * (compute / reference).powf(-self.exponent)
    }
}

/// L_u = s log10 C + i by least squares; none if C does not vary.
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

// The law with a floor.
//
// Variable projection: at each g the best E and k ≥ 0 are linear least squares, solved exactly, so
// one dimension is left. A scan over g brackets the best, and the zero of the projected
// objective's derivative is found there: a zero is known to machine precision, a minimum only to
// its square root.

/// The exponents searched. At the lower end the law is the log law to within a thousandth; at the
/// upper the loss reaches its floor within one decade.
pub(in crate::laws) const EXPONENT_RANGE: [f64; 2] = [1e-3, 5.0];
const SCAN_STEPS: usize = 80;

/// L_u = E + k (C/C0)^−g by least squares, C0 being `reference`.
///
/// None for fewer than three distinct C, or where no law with k > 0 beats a constant, that is, the
/// loss does not fall with C. An exponent at an end of its range (0.001 to 5) is a bound and no
/// optimum; [`FloorLaw::is_at_bound`] tells.
pub fn floor_law(compute: &[f64], loss: &[f64], reference: f64) -> Option<FloorLaw> {
    let problem = Projected::new(compute, loss, reference)?;
    let exponent = problem.best_exponent()?;
    let (floor, coefficient) = problem.linear(exponent);
    let fitted: Vec<f64> =
        problem.t.iter().map(|t| floor + coefficient * (-exponent * t).exp()).collect();
    Some(FloorLaw {
        floor,
        coefficient,
        exponent,
        r2: r2(loss, &fitted, &vec![1.0; loss.len()]),
        aic: aic(loss, &fitted, 3),
        n: loss.len(),
        ..FloorLaw::default()
    })
}

/// The objective of g alone.
struct Projected<'a> {
    /// ln C/C0.
    t: Vec<f64>,
    loss: &'a [f64],
}

impl<'a> Projected<'a> {
    fn new(compute: &[f64], loss: &'a [f64], reference: f64) -> Option<Self> {
        let t: Vec<f64> = compute.iter().map(|c| (c / reference).ln()).collect();
        let mut distinct = t.clone();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        (distinct.len() >= 3).then_some(Self { t, loss })
    }

    /// The residuals' sums that everything needs: centred basis, centred loss, and k.
    ///
    /// The basis is taken as e^(−gt) − 1, whose deviations keep their digits as g → 0.
    fn centred(&self, g: f64) -> (Vec<f64>, Vec<f64>, f64) {
        let basis = minus_mean(self.t.iter().map(|t| (-g * t).exp_m1()).collect());
        let loss = minus_mean(self.loss.to_vec());
        let k = dot(&basis, &loss) / dot(&basis, &basis);
        (basis, loss, k.max(0.0))
    }

    /// `None` if the loss does not fall (k = 0).
    fn rss(&self, g: f64) -> Option<f64> {
        let (basis, loss, k) = self.centred(g);
        let rss = || basis.iter().zip(&loss).map(|(b, l)| (l - k * b).powi(2)).sum();
        (k > 0.0).then(rss)
    }

    /// E and k at g.
    fn linear(&self, g: f64) -> (f64, f64) {
        let (_, _, k) = self.centred(g);
        let n = self.t.len() as f64;
        let mean_loss = self.loss.iter().sum::<f64>() / n;
        let mean_basis = self.t.iter().map(|t| (-g * t).exp()).sum::<f64>() / n;
        (mean_loss - k * mean_basis, k)
    }

    /// Half the derivative of the projected RSS in g. At the best E and k only the basis moves:
    /// −Σ r k ∂e^(−gt)/∂g = k Σ r t e^(−gt).
    fn slope(&self, g: f64) -> f64 {
        let (basis, loss, k) = self.centred(g);
        let residual = basis.iter().zip(&loss).map(|(b, l)| l - k * b);
        k * residual.zip(&self.t).map(|(r, t)| r * t * (-g * t).exp()).sum::<f64>()
    }

    fn best_exponent(&self) -> Option<f64> {
        let [low, high] = EXPONENT_RANGE;
        let step = (high / low).ln() / SCAN_STEPS as f64;
        let scan: Vec<f64> = (0..=SCAN_STEPS)
            .map(|i| if i == SCAN_STEPS { high } else { low * (step * i as f64).exp() })
            .collect();
        let falling = scan.iter().enumerate().filter_map(|(i, g)| Some((i, g, self.rss(*g)?)));
        let (best, g, _) = falling.min_by(|(.., a), (.., b)| a.total_cmp(b))?;
        let (left, right) = (scan[best.saturating_sub(1)], scan.get(best + 1).unwrap_or(g));
        Some(self.zero(left, *right).unwrap_or(*g))
    }

    /// The zero of the slope between two exponents; none if the slope does not change sign.
    fn zero(&self, left: f64, right: f64) -> Option<f64> {
        if self.slope(left) * self.slope(right) >= 0.0 {
            return None;
        }
        let solver = BrentRoot::new(left, right, 0.0);
        let run = Executor::new(self, solver).configure(|s| s.max_iters(200)).run().ok()?;
        run.state().get_best_param().copied()
    }
}

impl CostFunction for &Projected<'_> {
    type Param = f64;
    type Output = f64;

    fn cost(&self, g: &f64) -> Result<f64, Error> {
        Ok(self.slope(*g))
    }
}

fn minus_mean(mut v: Vec<f64>) -> Vec<f64> {
    let mean = v.iter().sum::<f64>() / v.len() as f64;
    v.iter_mut().for_each(|v| *v -= mean);
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_published_line_is_recovered_from_its_own_points() {
        let c = [1e14, 1e15, 1e16, 1e18];
        let law = log_law(&c, &c.map(|c: f64| -1.062 * c.log10() + 13.839)).unwrap();
        assert!((law.slope_per_decade + 1.062).abs() < 1e-12);
        assert!((law.intercept - 13.839).abs() < 1e-11);
        assert!((law.loss_at(1e18) + 5.277).abs() < 1e-12);
        assert!(law.r2 > 1.0 - 1e-12 && law.aic.is_finite());
    }

    const C: [f64; 6] = [1e14, 3e14, 1e15, 3e15, 1e16, 1e17];

    proptest! {
        #[test]
        fn a_law_with_a_floor_is_recovered_from_its_own_points(
            floor in -8.0..-3.0f64,
            coefficient in 0.3..3.0f64,
            exponent in 0.03..0.8f64,
        ) {
            let loss = C.map(|c| floor + coefficient * (c / 1e15).powf(-exponent));
            let law = floor_law(&C, &loss, 1e15).unwrap();
            prop_assert!((law.exponent / exponent - 1.0).abs() < 1e-7, "{law:?}");
            prop_assert!((law.floor - floor).abs() < 1e-6);
            prop_assert!((law.coefficient - coefficient).abs() < 1e-6);
            prop_assert!((law.loss_at(1e18, 1e15)
                - (floor + coefficient * 1e3f64.powf(-exponent))).abs() < 1e-6);
        }
    }

    #[test]
    fn a_straight_line_in_log_compute_drives_the_exponent_to_its_bound() {
        let law = floor_law(&C, &C.map(|c: f64| 13.0 - c.log10()), 1e15).unwrap();
        assert!(law.is_at_bound());
        assert!(law.r2 > 0.9999, "{}", law.r2);
    }

    #[test]
    fn a_loss_that_rises_with_compute_has_no_floor_law() {
        assert_eq!(floor_law(&C, &C.map(f64::log10), 1e15), None);
        assert_eq!(floor_law(&C, &[-2.0; 6], 1e15), None);
        assert_eq!(floor_law(&C[..2], &[-1.0, -2.0], 1e15), None);
    }
}
