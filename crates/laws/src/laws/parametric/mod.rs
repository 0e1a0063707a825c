//! Parametric laws of the loss, approach 3: one equation through every run.
//!
//! | step | file |
//! | --- | --- |
//! | the forms and their coefficients | `form` |
//! | objective, gradient, Hessian | `objective` |
//! | downhill to the last digit | `newton` |
//! | points into centred columns under a form | `target` |
//! | starts by variable projection | `search` |
//! | the law and the best allocation of a budget | `law` |
//! | intervals, and influential rows | `resampling` |
//! | options, the whole fit, its doubts | here |
//! | the implied laws | [`parametric_laws`](crate::laws::parametric_laws) |

mod form;
mod law;
mod newton;
mod objective;
mod resampling;
mod search;
mod target;
#[cfg(test)]
pub(in crate::laws) mod tests;

pub use form::{Coefficients, Form, Space};
pub use law::{Influence, Parametric, optimum, vocab_exponent};
pub use search::Starts;

use self::resampling::{Replicates, bootstrap, influence};
use self::search::{Found, search};
use self::target::{Data, Target};
use crate::laws::input::{FitError, IsoFlopPoint};
use crate::laws::maths::stats;

/// Huber's threshold between squares and absolute values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Huber {
    /// δ in units of the loss, or of its logarithm.
    Delta(f64),
    /// δ in units of the residuals' standard deviation, estimated from their median absolute
    /// deviation about a least-squares fit; 1.345 keeps 95 % of the precision that least squares
    /// has under normal noise (Huber 1981).
    Mad(f64),
    /// Least squares.
    None,
}

/// The seed by default, that of the analysis whose draws these are (`resampling.rs`).
const SEED: u64 = 42;

/// The options of [`fit_parametric`](crate::laws::fit_parametric).
#[derive(Clone, Debug, PartialEq)]
pub struct ParametricOptions {
    pub form: Form,
    pub space: Space,
    pub huber: Huber,
    pub starts: Starts,
    /// Keep the first exponent equal to the last (α1 = β, Tao et al. 2024).
    pub tied: bool,
    /// Least and largest exponent; one that ends there is no optimum, and is named.
    pub bounds: [f64; 2],
    /// Bootstrap replicates; 0 for none.
    pub bootstrap: usize,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// The budget whose optimum single rows should not move far; `None` to ask for none.
    pub influence_at: Option<f64>,
}

impl ParametricOptions {
    /// Logarithms and 1.345 MADs for approach 3, the loss itself with a vocabulary, 1000 replicates.
    pub fn of(form: Form) -> Self {
        let space = form.default_space();
        Self {
            form,
            space,
            huber: Huber::Mad(1.345),
            starts: Starts::Projected,
            tied: false,
            bounds: [0.02, 3.0],
            bootstrap: 1000,
            seed: SEED,
            influence_at: None,
        }
    }

    fn check(&self) -> Result<(), FitError> {
        let (Huber::Delta(delta) | Huber::Mad(delta)) = self.huber else { return Ok(()) };
        if delta.is_finite() && delta > 0.0 {
            return Ok(());
        }
        Err(FitError::BadOption {
            option: "huber",
            value: delta.to_string(),
            expected: "a finite number above 0",
        })
    }
}

/// The global optimum, how sure it is, and what speaks against it, which is not yet among the warnings.
///
/// # Errors
/// Those of [`fit_parametric`](crate::laws::fit_parametric).
pub(super) fn fitted(
    points: &[IsoFlopPoint],
    options: &ParametricOptions,
) -> Result<(Parametric, Vec<Finding>), FitError> {
    options.check()?;
    if points.is_empty() {
        return Err(FitError::NoPoints);
    }
    let data = Data::new(points, options.form, options.space)?;
    let target = target(&data, options)?;
    let found = found(&target, options)?;
    let replicates = bootstrap(points, &target, &found, (options.seed, options.bootstrap));
    let influence =
        options.influence_at.and_then(|budget| influence(points, &target, &found, budget));
    let own = summarised(&target, &found, &replicates, influence);
    let findings = findings(&target, &found, &own.coefficients, &replicates);
    Ok((own, findings))
}

fn found(target: &Target, options: &ParametricOptions) -> Result<Found, FitError> {
    search(target, options.starts).ok_or_else(|| {
        FitError::NotIdentified("no start leads to a finite objective; look at the rows".into())
    })
}

/// The target with δ in the loss's own units.
fn target<'a>(data: &'a Data, options: &ParametricOptions) -> Result<Target<'a>, FitError> {
    let ParametricOptions { form, space, tied, bounds, .. } = *options;
    let squares = Target { data, form, space, delta: f64::INFINITY, tied, bounds };
    let delta = match options.huber {
        Huber::Delta(delta) => delta,
        Huber::None => f64::INFINITY,
        Huber::Mad(factor) => factor * spread(&squares, &found(&squares, options)?),
    };
    Ok(Target { delta, ..squares })
}

/// The residuals' standard deviation by their median absolute deviation; infinite for an exact fit,
/// where squares do as well.
fn spread(target: &Target, found: &Found) -> f64 {
    let coefficients = target.coefficients(&found.end.theta);
    let deviations: Vec<f64> = residuals(target, &coefficients).into_iter().map(f64::abs).collect();
    let typical = target.data.columns.y.iter().fold(0.0f64, |most, y| most.max(y.abs()));
    let median = stats::quantile(&deviations, 0.5).unwrap_or(0.0);
    if median <= 1e-12 * typical { f64::INFINITY } else { stats::SD_PER_MAD * median }
}

/// y − q of every row, in the space of the fit.
fn residuals(target: &Target, coefficients: &Coefficients) -> Vec<f64> {
    let Data { columns, means, .. } = target.data;
    let loss = |i: usize| {
        let quantities: Vec<f64> =
            columns.x.iter().zip(means).map(|(x, mean)| (x[i] + mean).exp()).collect();
        coefficients.loss(&quantities)
    };
    (0..columns.n).map(|i| columns.y[i] - target.space.of(loss(i))).collect()
}

fn summarised(
    target: &Target,
    found: &Found,
    replicates: &Replicates,
    influence: Option<Influence>,
) -> Parametric {
    let coefficients = without_absent(target, target.coefficients(&found.end.theta));
    let has_all_terms = (0..target.form.n_terms()).all(|term| coefficients.coefficient(term) > 0.0);
    let total: f64 = target.data.weights.iter().sum();
    let objective = match target.space {
        Space::Log => found.end.minimised.value,
        Space::Raw => found.end.minimised.value / total,
    };
    let n = target.data.columns.n;
    let y = &target.data.columns.y[..n];
    let fitted: Vec<f64> =
        y.iter().zip(residuals(target, &coefficients)).map(|(y, r)| y - r).collect();
    Parametric {
        coefficients,
        space: target.space,
        tied: target.tied,
        huber_delta: target.delta.is_finite().then_some(target.delta),
        objective,
        objective_sum: found.end.minimised.value,
        gradient_norm: found.end.minimised.gradient_norm,
        starts: found.starts,
        starts_at_optimum: found.starts_at_optimum,
        n,
        r2: stats::r2(y, &fitted, &target.data.weights[..n]),
        aic: stats::aic(y, &fitted, target.form.n_params()),
        se: replicates.standard_errors(),
        ci95: replicates.intervals(),
        replicates_converged: replicates.converged,
        bootstrap: replicates.coefficients.clone(),
        warnings: Vec::new(),
        influence: influence.filter(|_| has_all_terms),
    }
}

// What speaks against a fit.

/// Share of starts at the optimum below which a second optimum may have been missed.
const FEW_STARTS: f64 = 0.1;
/// Rows for each coefficient below which a bootstrap understates.
const ENOUGH_ROWS: usize = 6;
/// Rows for each coefficient below which a law follows single rows.
pub(super) const LEAST_ROWS: usize = 3;
/// Share of the mean loss below which a term counts as absent.
const ABSENT: f64 = 1e-4;

/// A reason to believe a parametric fit less.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Finding {
    /// The term of this quantity is absent from the best fit.
    TermAbsent(&'static str),
    /// The exponent of a quantity is held at a bound.
    AtBound(&'static str, f64),
    NoFloor,
    /// Starts that reach the optimum, of all.
    FewStarts(usize, usize),
    /// Replicates without an optimum of their own, of all.
    Unfinished(usize, usize),
    /// Rows fewer than [`LEAST_ROWS`] times the coefficients.
    TooFewRows(usize, usize),
    /// Rows for coefficients, few for a bootstrap.
    FewRows(usize, usize),
}

fn findings(
    target: &Target,
    found: &Found,
    coefficients: &Coefficients,
    replicates: &Replicates,
) -> Vec<Finding> {
    let share = found.starts_at_optimum as f64 / found.starts as f64;
    let few_starts = Finding::FewStarts(found.starts_at_optimum, found.starts);
    let missing = replicates.asked - replicates.converged;
    let mut all = terms(target, coefficients);
    all.extend((share < FEW_STARTS).then_some(few_starts));
    all.extend((missing > 0).then_some(Finding::Unfinished(missing, replicates.asked)));
    all.extend(few_rows(target, replicates));
    all
}

fn terms(target: &Target, coefficients: &Coefficients) -> Vec<Finding> {
    let mut all = Vec::new();
    for (term, quantity) in target.form.quantities().iter().enumerate() {
        let exponent = coefficients.exponent(term);
        if is_absent(target, coefficients, term) {
            all.push(Finding::TermAbsent(quantity));
        } else if target.bounds.contains(&exponent) {
            all.push(Finding::AtBound(quantity, exponent));
        }
    }
    let typical = typical(target);
    all.extend((coefficients.floor().abs() < ABSENT * typical).then_some(Finding::NoFloor));
    all
}

/// The mean size of a loss.
fn typical(target: &Target) -> f64 {
    let losses = &target.data.losses;
    losses.iter().map(|l| l.abs()).sum::<f64>() / losses.len() as f64
}

fn is_absent(target: &Target, coefficients: &Coefficients, term: usize) -> bool {
    let of_mean = (-coefficients.exponent(term) * target.data.means[term]).exp();
    coefficients.coefficient(term) * of_mean < ABSENT * typical(target)
}

/// The coefficients, with 0 for an absent term of the model or of the data: without one there is no optimum. The
/// optimum of the others stands without the term of N_v.
fn without_absent(target: &Target, coefficients: Coefficients) -> Coefficients {
    let mut values = coefficients.values().to_vec();
    for (term, quantity) in target.form.quantities().iter().enumerate() {
        if *quantity != "N_v" && is_absent(target, &coefficients, term) {
            values[1 + term] = 0.0;
        }
    }
    Coefficients::new(target.form, &values).unwrap_or(coefficients)
}

fn few_rows(target: &Target, replicates: &Replicates) -> Option<Finding> {
    let (rows, coefficients) = (target.data.columns.n, target.form.n_params());
    if rows < LEAST_ROWS * coefficients {
        return Some(Finding::TooFewRows(rows, coefficients));
    }
    let few = replicates.asked > 0 && rows < ENOUGH_ROWS * coefficients;
    few.then_some(Finding::FewRows(rows, coefficients))
}
