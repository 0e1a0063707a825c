//! Least squares by Levenberg and Marquardt's damped steps, as a solver of argmin; and a straight line by it.
//!
//! It fits the power laws, the log law and the joint law. Two fits have other solvers of argmin: approach 3 has second
//! derivatives, and the law with a floor has a single exponent once the rest is projected out; the zero of a slope
//! is more precise than a least sum.

use argmin::core::{
    Error, Executor, IterState, KV, Problem as Counted, Solver, State, TerminationReason,
};

use super::solve;

/// Coefficients of a law at most.
pub(in crate::laws) const MOST: usize = 12;
/// A number for each coefficient, and zeros after the last.
pub(in crate::laws) type Row<const N: usize = MOST> = [f64; N];

/// Steps until a search is given up.
pub(in crate::laws) const MOST_STEPS: usize = 200;
/// Relative fall of the sum of squares below which a step counts as none.
const DONE: f64 = 1e-12;
const MOST_DAMPING: f64 = 1e12;
/// Relative fall promised by a full step below which only rounding remains.
const EXACT: f64 = 1e-24;

/// Residuals of a model.
pub(in crate::laws) trait Residuals<const N: usize = MOST> {
    /// Whether steps are taken in full without a test: a linear model is at its minimum after one step, and steps with
    /// Huber's weights never go uphill.
    const FULL_STEPS: bool = false;
    /// The sum of their squares.
    fn sum(&self, values: &[f64]) -> f64;
    /// Tells `take` every residual, and minus its derivatives.
    fn each(&self, values: &[f64], take: &mut dyn FnMut(f64, &Row<N>));
    /// Moves values that left their bounds back onto them.
    fn bound(&self, _values: &mut [f64]) {}
}

/// The values of the least sum of squares downhill from `start`, after at most `most_steps` steps, and
/// that sum.
pub(in crate::laws) fn minimise<const N: usize>(
    problem: &impl Residuals<N>,
    start: Vec<f64>,
    most_steps: usize,
) -> (Vec<f64>, f64) {
    let mut state = Executor::new(problem, Levenberg::<N> { damping: 1e-3 })
        .configure(|state: Iterate| state.param(start).max_iters(most_steps as u64))
        .run()
        .expect("the solver has no errors")
        .state;
    (state.take_param().expect("every step leaves values"), state.get_cost())
}

type Iterate = IterState<Vec<f64>, (), (), (), (), f64>;

struct Levenberg<const N: usize> {
    damping: f64,
}

impl<const N: usize, P: Residuals<N>> Solver<&P, Iterate> for Levenberg<N> {
    fn name(&self) -> &str {
        "Levenberg-Marquardt"
    }

    fn init(
        &mut self,
        problem: &mut Counted<&P>,
        state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let values = state.get_param().ok_or_else(|| Error::msg("no start"))?;
        let sum = problem.problem("sum", |problem| Ok(problem.sum(values)))?;
        Ok((state.cost(sum), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Counted<&P>,
        mut state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let values = state.take_param().ok_or_else(|| Error::msg("no values"))?;
        let least = state.get_cost();
        let step = problem.problem("step", |own| Ok(self.downhill(*own, &values, least)))?;
        let (there, next, done) = match step {
            Some((there, next)) => (there, next, !P::FULL_STEPS && (least - there) / least < DONE),
            None => (least, values, true),
        };
        let state = state.param(next).cost(there);
        let converged = TerminationReason::SolverConverged;
        Ok((if done { state.terminate_with(converged) } else { state }, None))
    }
}

impl<const N: usize> Levenberg<N> {
    /// The next sum and its values; `None` if no step helps.
    fn downhill<P: Residuals<N>>(
        &mut self,
        problem: &P,
        values: &[f64],
        least: f64,
    ) -> Option<(f64, Vec<f64>)> {
        let normal = Normal::of(problem, values);
        let with_sum = |next: Vec<f64>| (problem.sum(&next), next);
        if P::FULL_STEPS {
            let next = normal.step(problem, values, 0.0)?;
            let moved = next.iter().zip(values).zip(&normal.right);
            let promised: f64 = moved.map(|((next, value), right)| (next - value) * right).sum();
            return (promised > EXACT * least).then(|| with_sum(next));
        }
        while self.damping < MOST_DAMPING {
            let next = normal.step(problem, values, self.damping).map(with_sum);
            if let Some((there, next)) = next.filter(|(there, _)| *there < least) {
                self.damping = (self.damping * 0.2).max(1e-12);
                return Some((there, next));
            }
            self.damping *= 5.0;
        }
        None
    }
}

/// JᵀJ, below and on its diagonal, and Jᵀr.
struct Normal<const N: usize> {
    matrix: [Row<N>; N],
    right: Row<N>,
}

impl<const N: usize> Normal<N> {
    fn of(problem: &impl Residuals<N>, values: &[f64]) -> Self {
        let mut own = Self { matrix: [[0.0; N]; N], right: [0.0; N] };
        problem.each(values, &mut |residual, slopes| {
            for (i, slope) in slopes.iter().enumerate().take(values.len()) {
                own.right[i] += slope * residual;
                let row = own.matrix[i].iter_mut().zip(slopes).take(i + 1);
                row.for_each(|(sum, other)| *sum += slope * other);
            }
        });
        own
    }

    /// The values after a step damped in units of each column's length.
    fn step(&self, problem: &impl Residuals<N>, values: &[f64], damping: f64) -> Option<Vec<f64>> {
        let p = values.len();
        let mut matrix = self.matrix;
        (0..p).for_each(|i| matrix[i][i] += damping * matrix[i][i].max(1e-18));
        let change = solve(&matrix, 0.0, &self.right, p)?;
        let mut next: Vec<f64> = values.iter().zip(change).map(|(v, step)| v + step).collect();
        problem.bound(&mut next);
        next.iter().all(|value| value.is_finite()).then_some(next)
    }
}

// A straight line, of least squares or of Huber's.

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
    /// `None` if x does not vary.
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

/// Steps of reweighted least squares, equal to Newton's if no residual is large.
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

/// The least-squares line around the weighted mean of x; none if x does not vary.
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

    /// y = a e^(−b x) at some x, b held above 0.1.
    struct Decay(Vec<(f64, f64)>);

    impl Residuals for Decay {
        fn sum(&self, v: &[f64]) -> f64 {
            self.0.iter().map(|(x, y)| (y - v[0] * (-v[1] * x).exp()).powi(2)).sum()
        }

        fn each(&self, v: &[f64], take: &mut dyn FnMut(f64, &Row)) {
            for (x, y) in &self.0 {
                let e = (-v[1] * x).exp();
                let mut row = [0.0; MOST];
                (row[0], row[1]) = (e, -v[0] * x * e);
                take(y - v[0] * e, &row);
            }
        }

        fn bound(&self, values: &mut [f64]) {
            values[1] = values[1].max(0.1);
        }
    }

    fn decay(a: f64, b: f64) -> Decay {
        Decay((0..20).map(|i| 0.3 * f64::from(i)).map(|x| (x, a * (-b * x).exp())).collect())
    }

    #[test]
    fn known_coefficients_are_found_from_afar() {
        let (values, sum) = minimise(&decay(3.0, 0.7), vec![0.1, 4.0], MOST_STEPS);
        assert!((values[0] - 3.0).abs() < 1e-6 && (values[1] - 0.7).abs() < 1e-6, "{values:?}");
        assert!(sum < 1e-12);
    }

    #[test]
    fn bounds_hold() {
        let (values, _) = minimise(&decay(3.0, 0.01), vec![1.0, 1.0], MOST_STEPS);
        assert_eq!(values[1], 0.1);
    }

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
