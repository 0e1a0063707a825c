//! A parametric law fitted to a table of runs.

use super::bootstrap::{Replicates, bootstrap};
use super::data::Data;
use super::findings::{Finding, findings};
use super::form::Coefficients;
use super::influence::{Influence, influence};
use super::objective::Space;
use super::options::{Huber, ParametricOptions};
use super::search::{Found, Target, search};
use super::types::Parametric;
use crate::laws::input::error::FitError;
use crate::laws::input::point::IsoFlopPoint;
use crate::laws::maths::stats;

/// The global optimum, how sure it is, and what speaks against it, which is not yet among the warnings.
///
/// # Errors
/// Those of [`fit_parametric`](crate::laws::fit_parametric).
pub(in crate::laws) fn fitted(
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
    let replicates = bootstrap(points, &target, &found, options);
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
pub(super) fn residuals(target: &Target, coefficients: &Coefficients) -> Vec<f64> {
    let Data { columns, means, .. } = target.data;
    let loss = |i: usize| {
        let quantities: Vec<f64> =
            columns.x.iter().zip(means).map(|(x, mean)| (x[i] + mean).exp()).collect();
        coefficients.loss(&quantities)
    };
    let predicted = |i| match target.space {
        Space::Log => loss(i).ln(),
        Space::Raw => loss(i),
    };
    (0..columns.n).map(|i| columns.y[i] - predicted(i)).collect()
}

fn summarised(
    target: &Target,
    found: &Found,
    replicates: &Replicates,
    influence: Option<Influence>,
) -> Parametric {
    let coefficients = target.coefficients(&found.end.theta);
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
        influence,
    }
}
