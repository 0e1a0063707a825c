//! Newton's method with Levenberg's damping, as a solver of argmin.
//!
//! Each step solves (H + λI) s = −g with the exact Hessian H. λ falls while the quadratic model
//! predicts well and grows while it does not or while H + λI is not positive definite, so the
//! method goes downhill from anywhere and converges quadratically near an optimum. With Huber's
//! function H changes by jumps as rows cross δ; damping takes care of that too.
//!
//! It stops once the model promises less than one part in 10^15 of the objective: a relative criterion, so neither
//! a small δ nor a mean over rows stops it early. Within bounds it also stops after ten steps in a row that take
//! exponents further out: the way to an optimum at infinity has hundreds of steps, which the bounds would undo.

use super::form::{MAX_PARAMS, Matrix, Slots, Vector};
use super::objective::{Evaluation, Objective};
use crate::laws::maths::solve;
use argmin::core::{
    Error, Executor, IterState, KV, Problem as Counted, Solver, State, TerminationReason,
    TerminationStatus,
};

/// An objective with some parameters frozen and some tied to move together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Problem<'a> {
    pub objective: Objective<'a>,
    slots: Slots,
    /// Values of the frozen ones.
    base: Vector,
    /// Least and largest exponent: a step may leave them, [`OUTWARD`] steps in a row end the search.
    bounds: [f64; 2],
    pub n_free: usize,
}

impl<'a> Problem<'a> {
    /// Parameters of equal slots move together; the slots need not be consecutive.
    pub fn new(objective: Objective<'a>, slots: Slots, base: Vector) -> Self {
        let mut used: Vec<usize> = slots.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        let renumbered = slots.map(|slot| slot.and_then(|s| used.binary_search(&s).ok()));
        let bounds = [f64::NEG_INFINITY, f64::INFINITY];
        Self { objective, slots: renumbered, base, bounds, n_free: used.len() }
    }

    /// The same, to be left unfinished once its exponents leave these bounds for good.
    pub fn within(self, bounds: [f64; 2]) -> Self {
        Self { bounds, ..self }
    }

    /// All parameters, from the free ones.
    pub fn full(&self, free: &Vector) -> Vector {
        std::array::from_fn(|p| self.slots[p].map_or(self.base[p], |slot| free[slot]))
    }

    /// The free parameters at some values of all; tied ones should agree there.
    pub fn free(&self, full: &Vector) -> Vector {
        let mut free = [0.0; MAX_PARAMS];
        for (slot, value) in self.slots.iter().zip(full) {
            if let Some(slot) = slot {
                free[*slot] = *value;
            }
        }
        free
    }

    /// How far the exponents are outside their bounds, in sum.
    fn outside(&self, free: &Vector) -> f64 {
        let (full, [least, most]) = (self.full(free), self.bounds);
        let k = self.objective.columns.x.len();
        full[k + 1..=2 * k].iter().map(|e| (e - e.clamp(least, most)).abs()).sum()
    }

    /// Value, gradient and Hessian in the free parameters.
    pub fn evaluate(&self, free: &Vector) -> Evaluation {
        let full = self.objective.evaluate(&self.full(free));
        let mut reduced = Evaluation {
            value: full.value,
            gradient: [0.0; MAX_PARAMS],
            hessian: [[0.0; MAX_PARAMS]; MAX_PARAMS],
        };
        for (p, row) in self.slots.iter().enumerate() {
            let Some(row) = row else { continue };
            reduced.gradient[*row] += full.gradient[p];
            for (q, column) in self.slots.iter().enumerate() {
                let Some(column) = column else { continue };
                reduced.hessian[*row][*column] += full.hessian[p][q];
            }
        }
        reduced
    }
}

/// Relative decrease of the objective that is below its rounding, so not worth a step.
pub(super) const EXACT: f64 = 1e-15;
/// Longest step, in natural logarithms and exponents.
const LONGEST_STEP: f64 = 4.0;
const MAX_STEPS: u64 = 400;
/// Steps in a row that take exponents further out of their bounds and end a search.
const OUTWARD: usize = 10;
/// λ in units of the Hessian's largest entry at the start.
const FIRST_DAMPING: f64 = 1e-3;

type Iterate = IterState<Vector, Vector, (), Matrix, (), f64>;

/// The end of a search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Minimised {
    /// The free parameters.
    pub free: Vector,
    pub value: f64,
    /// The Euclidean norm of the gradient there.
    pub gradient_norm: f64,
    /// Whether it ended because nothing was left to gain.
    pub converged: bool,
}

/// Goes downhill from `start`; none if the objective has no finite value there.
pub(super) fn minimise(problem: Problem, start: Vector, tolerance: f64) -> Option<Minimised> {
    let n = problem.n_free;
    let solver = DampedNewton { damping: 0.0, tolerance, outside: 0.0, outward: 0 };
    let run = Executor::new(problem, solver)
        .configure(|state: Iterate| state.param(start).max_iters(MAX_STEPS))
        .timer(false)
        .run()
        .ok()?;
    let state = run.state();
    let gradient = state.get_gradient()?;
    let done = TerminationStatus::Terminated(TerminationReason::SolverConverged);
    Some(Minimised {
        free: *state.get_param()?,
        value: state.get_cost(),
        gradient_norm: dot(gradient, gradient, n).sqrt(),
        converged: *state.get_termination_status() == done,
    })
}

struct DampedNewton {
    /// λ.
    damping: f64,
    /// Relative decrease of the objective that is not worth a step.
    tolerance: f64,
    /// How far the exponents are outside their bounds.
    outside: f64,
    /// Steps in a row that took them further out.
    outward: usize,
}

impl<'a> Solver<Problem<'a>, Iterate> for DampedNewton {
    fn name(&self) -> &str {
        "damped Newton"
    }

    fn init(
        &mut self,
        problem: &mut Counted<Problem<'a>>,
        mut state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let start = state.take_param().ok_or_else(|| Error::msg("no start"))?;
        let there = evaluate(problem, &start)?;
        if !there.value.is_finite() {
            return Err(Error::msg("the objective has no finite value at the start"));
        }
        self.damping = FIRST_DAMPING * largest(&there.hessian);
        self.goes_outward(problem, &start);
        self.outward = 0;
        Ok((moved(state, start, &there), None))
    }

    fn next_iter(
        &mut self,
        problem: &mut Counted<Problem<'a>>,
        mut state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let missing = || Error::msg("the solver was not initialised");
        let at = state.take_param().ok_or_else(missing)?;
        let gradient = state.take_gradient().ok_or_else(missing)?;
        let hessian = state.take_hessian().ok_or_else(missing)?;
        let here = Evaluation { value: state.get_cost(), gradient, hessian };
        match self.descend(problem, &at, &here)? {
            Some((there, evaluation)) => {
                let outward = self.goes_outward(problem, &there);
                let state = moved(state, there, &evaluation);
                let left = TerminationReason::SolverExit("exponents leave their bounds".into());
                Ok((if outward { state.terminate_with(left) } else { state }, None))
            }
            None => {
                let state = moved(state, at, &here);
                Ok((state.terminate_with(TerminationReason::SolverConverged), None))
            }
        }
    }
}

impl DampedNewton {
    /// Whether the last steps have led further and further outside the bounds.
    fn goes_outward(&mut self, problem: &Counted<Problem>, at: &Vector) -> bool {
        let outside = problem.problem.as_ref().map_or(0.0, |p| p.outside(at));
        self.outward = if outside > self.outside { self.outward + 1 } else { 0 };
        self.outside = outside;
        self.outward >= OUTWARD
    }

    /// The next point, strictly lower; `None` if there is none.
    fn descend(
        &mut self,
        problem: &mut Counted<Problem>,
        at: &Vector,
        here: &Evaluation,
    ) -> Result<Option<(Vector, Evaluation)>, Error> {
        let n = problem.problem.as_ref().map_or(0, |p| p.n_free);
        let scale = largest(&here.hessian).max(f64::MIN_POSITIVE);
        let downhill = here.gradient.map(|g| -g);
        loop {
            let Some(step) = solve(&here.hessian, self.damping, &downhill, n) else {
                self.damping = (4.0 * self.damping).max(1e-12 * scale);
                if self.damping > 1e12 * scale {
                    return Ok(None);
                }
                continue;
            };
            let step = shortened(step, n);
            let promised = promise(here, &step, n);
            if promised <= self.tolerance * here.value {
                return Ok(None);
            }
            let there: Vector = std::array::from_fn(|i| at[i] + step[i]);
            let evaluation = evaluate(problem, &there)?;
            let ratio = (here.value - evaluation.value) / promised;
            if ratio > 0.75 {
                self.damping = if self.damping < 1e-9 * scale { 0.0 } else { 0.1 * self.damping };
            } else if ratio.is_nan() || ratio < 0.25 {
                self.damping = (4.0 * self.damping).max(1e-6 * scale);
            }
            if evaluation.value < here.value {
                return Ok(Some((there, evaluation)));
            }
        }
    }
}

fn evaluate(problem: &mut Counted<Problem>, at: &Vector) -> Result<Evaluation, Error> {
    problem.problem("evaluate", |problem| Ok(problem.evaluate(at)))
}

fn moved(state: Iterate, to: Vector, there: &Evaluation) -> Iterate {
    state.param(to).cost(there.value).gradient(there.gradient).hessian(there.hessian)
}

/// The gain of the step by the quadratic model.
fn promise(here: &Evaluation, step: &Vector, n: usize) -> f64 {
    let bent = times(&here.hessian, step, n);
    -dot(&here.gradient, step, n) - 0.5 * dot(&bent, step, n)
}

fn shortened(step: Vector, n: usize) -> Vector {
    let length = dot(&step, &step, n).sqrt();
    if length > LONGEST_STEP { step.map(|s| s * LONGEST_STEP / length) } else { step }
}

fn largest(hessian: &Matrix) -> f64 {
    hessian.iter().flatten().fold(0.0, |most: f64, h| most.max(h.abs()))
}

/// The scalar product of the first `n` entries.
fn dot(a: &Vector, b: &Vector, n: usize) -> f64 {
    (0..n).map(|i| a[i] * b[i]).sum()
}

/// The first `n` entries of M v.
pub(super) fn times(m: &Matrix, v: &Vector, n: usize) -> Vector {
    std::array::from_fn(|i| if i < n { dot(&m[i], v, n) } else { 0.0 })
}
