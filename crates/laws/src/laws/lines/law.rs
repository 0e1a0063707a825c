//! Laws of one variable: power laws by a straight line in logarithms (ScaMo Eqs. 9 and 10), and the loss in C.

#[cfg(test)]
mod tests;

use crate::laws::maths::engine::{Line, Points, least_squares_line};
use crate::laws::maths::stats::{SD_PER_MAD, aic, dot, interval95, quantile, r2};
use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::brent::BrentRoot;
use serde::{Deserialize, Serialize};
use std::f64::consts::LN_10;

/// log10 y = `log10_coefficient` + `exponent` · log10 x.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PowerLaw {
    pub log10_coefficient: f64,
    pub exponent: f64,
    /// ln y at the reference budget of [`Laws::reference_flops`](crate::laws::Laws::reference_flops); the well-determined intercept.
    /// For N_v in N_nv it is ln N_v at the geometric mean of the fitted N_nv.
    pub ln_at_reference: f64,
    /// 1 − RSS/TSS in ln y; 0 if y does not vary, and where a published law gives none (`n` 0).
    pub r2: f64,
    /// 95 % bootstrap percentile interval; absent if too few points allow none.
    pub exponent_ci95: Option<[f64; 2]>,
    pub ln_at_reference_ci95: Option<[f64; 2]>,
    pub log10_coefficient_ci95: Option<[f64; 2]>,
    /// Points fitted; 0 for a published law.
    pub n: usize,
}

impl PowerLaw {
    /// y at x by the coefficient and the exponent alone.
    pub fn value_at(&self, x: f64) -> f64 {
        10f64.powf(self.log10_coefficient + self.exponent * x.log10())
    }

    /// R², with more than two points.
    pub fn told_r2(&self) -> Option<f64> {
        (self.n > 2).then_some(self.r2)
    }

    /// Sets the interval of each coefficient; `coefficients` holds ln y at C0 and the exponent of each replicate.
    pub(in crate::laws) fn set_intervals(
        &mut self,
        coefficients: &[(f64, f64)],
        ln_reference: f64,
    ) {
        let interval =
            |value: &dyn Fn(&(f64, f64)) -> f64| interval95(coefficients.iter().map(value));
        self.exponent_ci95 = interval(&|(_, exponent)| *exponent);
        self.ln_at_reference_ci95 = interval(&|(level, _)| *level);
        self.log10_coefficient_ci95 =
            interval(&|(level, exponent)| (level - exponent * ln_reference) / LN_10);
    }
}

/// The power law y = y(x0) (x/x0)^exponent through points, least squares in ln y, x0 being
/// `reference`.
///
/// `weights` has one positive number per point. With `huber`, its δ in units of the residuals' scaled MAD, distant
/// points count linearly; see [`crate::laws::input::FitOptions::huber`]. `None` with fewer than two points or if x
/// does not vary. All values must be positive.
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
        Some(delta) => huber_line(&x, &y, weights, delta)?,
        None => least_squares_line(&x, &y, weights)?,
    };
    Some(from_line(&line, &x, &y, reference, weights))
}

/// The law of a line in natural logarithms.
pub(super) fn from_line(
    line: &Line,
    ln_x: &[f64],
    ln_y: &[f64],
    reference: f64,
    weights: &[f64],
) -> PowerLaw {
    let fitted: Vec<f64> = ln_x.iter().map(|x| line.at(*x)).collect();
    PowerLaw {
        log10_coefficient: line.at(0.0) / LN_10,
        exponent: line.slope,
        ln_at_reference: line.at(reference.ln()),
        r2: r2(ln_y, &fitted, weights),
        n: ln_x.len(),
        ..PowerLaw::default()
    }
}

// Huber's line by iteratively reweighted least squares.
//
// Minimises Σ w ρ((y − line)/s), ρ(r) = r²/2 up to δ and δ(|r| − δ/2) beyond. The scale s is
// 1.4826 times the median absolute residual of the Theil-Sen line, which up to 29 % of arbitrary
// points cannot move, and stays fixed: the objective is then convex, so the iteration finds its
// one minimum from any start.

/// Huber's line with `delta` in units of the scaled MAD; none if x does not vary.
///
/// If more than half of the points lie on the Theil-Sen line, so that s is 0, that line is returned: it is the limit
/// of Huber's as s → 0.
fn huber_line(x: &[f64], y: &[f64], weights: &[f64], delta: f64) -> Option<Line> {
    let line = theil_sen(x, y)?;
    let scale = SD_PER_MAD * median_residual(&line, x, y);
    let magnitude = y.iter().fold(0.0f64, |m, y| m.max(y.abs()));
    if scale <= 4.0 * f64::EPSILON * magnitude {
        return Some(line);
    }
    Some(Points::new(x, y, weights)?.huber_line(&line, delta * scale))
}

/// The line whose slope is the median over pairs, and whose level is the median residual.
fn theil_sen(x: &[f64], y: &[f64]) -> Option<Line> {
    let pairs = (0..x.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let slopes: Vec<f64> =
        pairs.filter(|(i, j)| x[*i] != x[*j]).map(|(i, j)| (y[i] - y[j]) / (x[i] - x[j])).collect();
    let slope = quantile(&slopes, 0.5)?;
    let centre = x.iter().sum::<f64>() / x.len() as f64;
    let levels: Vec<f64> = x.iter().zip(y).map(|(x, y)| y - slope * (x - centre)).collect();
    Some(Line { centre, level: quantile(&levels, 0.5)?, slope })
}

fn median_residual(line: &Line, x: &[f64], y: &[f64]) -> f64 {
    let residuals: Vec<f64> = x.iter().zip(y).map(|(x, y)| (y - line.at(*x)).abs()).collect();
    quantile(&residuals, 0.5).unwrap_or(0.0)
}

// The loss in C: a straight line in log10 C (ScaMo Eq. 14), and a power law with a floor, E + k (C/C0)^−g.

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
