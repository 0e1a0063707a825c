//! Their approach 1: laws through the runs that no cheaper run matches.

use super::grid::Grid;
use super::interpolate::Stop;
use super::{DELTA, FrontierError, FrontierPoint, huber, interpolate};
use crate::laws::input::point::IsoFlopPoint;
use crate::laws::maths::line::{Line, least_squares_line};

/// Which points compete for the frontier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The runs and points interpolated between them, as published.
    #[default]
    Published,
    /// The same, with the gradients of the surface between models swept until they settle. The
    /// published ones stop after one sweep, by a tolerance that small gradients meet at once; on
    /// the published runs this moves s from .4356 to .4307.
    Converged,
    /// The runs alone.
    None,
}

impl Interpolation {
    fn stop(self) -> Option<Stop> {
        match self {
            Self::Published => Some(Stop::PUBLISHED),
            Self::Converged => Some(Stop::CONVERGED),
            Self::None => None,
        }
    }
}

/// What the laws of a frontier make least.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Criterion {
    /// The sum of Huber losses of δ = 1e-3 in ln N, as published; nearly the absolute residuals.
    #[default]
    Huber,
    /// The sum of squares.
    LeastSquares,
}

/// N_nv = e^K C^0.5 and N_v = e^K' C^s.
#[derive(Clone, Debug, PartialEq)]
pub struct FrontierLaws {
    /// K, the exponent being held at 0.5.
    pub ln_nonvocab: f64,
    /// s.
    pub exponent_vocab: f64,
    /// K'.
    pub ln_vocab: f64,
    /// The criterion at the law of N_v, as a sum.
    pub objective_vocab: f64,
    /// Points of the frontier.
    pub n: usize,
}

/// The frontier of loss in compute (Tao et al. 2024, approach 1): sorted by FLOPs, every point of
/// less loss than all before it.
///
/// With [`Interpolation::Published`] two kinds of points join the runs, each with the FLOPs
/// 6 (N_nv + V d(N_nv)) H f(V): for each vocabulary, at 50 pairs of N_nv and H that grow evenly in
/// logarithms, the smooth cubic surface through its runs over (N_nv, H), as scipy's
/// `griddata(method="cubic")` draws it in raw units; for each model, at 20 values of V, the
/// quadratic spline in V through the last checkpoints.
///
/// # Errors
/// [`FrontierError`] for a value that is not positive and, with interpolation, for runs that are no
/// full grid of models, vocabularies and checkpoints.
pub fn frontier(
    points: &[IsoFlopPoint],
    interpolation: Interpolation,
) -> Result<Vec<FrontierPoint>, FrontierError> {
    points.iter().try_for_each(check)?;
    let mut all: Vec<FrontierPoint> = points.iter().map(from_run).collect();
    if let Some(stop) = interpolation.stop() {
        all.extend(interpolate::between(&Grid::new(points)?, stop)?);
    }
    all.sort_by(|a, b| a.flops.total_cmp(&b.flops));
    let mut least = f64::INFINITY;
    all.retain(|point| {
        let better = point.loss_normalised < least;
        least = least.min(point.loss_normalised);
        better
    });
    Ok(all)
}

/// The two power laws through a frontier; none for fewer than two points.
///
/// The optimum is exact; a descent such as the published L-BFGS stops a little above it.
pub fn frontier_laws(frontier: &[FrontierPoint], criterion: Criterion) -> Option<FrontierLaws> {
    let ln =
        |of: fn(&FrontierPoint) -> f64| frontier.iter().map(|p| of(p).ln()).collect::<Vec<_>>();
    let (c, nonvocab, vocab) = (ln(|p| p.flops), ln(|p| p.params_nonvocab), ln(|p| p.params_vocab));
    let rest: Vec<f64> = nonvocab.iter().zip(&c).map(|(n, c)| n - 0.5 * c).collect();
    let line = match criterion {
        Criterion::Huber => huber::line(&c, &vocab, DELTA)?,
        Criterion::LeastSquares => least_squares_line(&c, &vocab, &vec![1.0; c.len()])?,
    };
    let ln_nonvocab = match criterion {
        Criterion::Huber => huber::location(&rest, DELTA)?,
        Criterion::LeastSquares => rest.iter().sum::<f64>() / rest.len() as f64,
    };
    Some(FrontierLaws {
        ln_nonvocab,
        exponent_vocab: line.slope,
        ln_vocab: line.at(0.0),
        objective_vocab: objective(&line, &c, &vocab, criterion),
        n: frontier.len(),
    })
}

fn objective(line: &Line, x: &[f64], y: &[f64], criterion: Criterion) -> f64 {
    let residuals = x.iter().zip(y).map(|(x, y)| y - line.at(*x));
    match criterion {
        Criterion::Huber => huber::objective(residuals, DELTA),
        Criterion::LeastSquares => residuals.map(|r| r * r).sum(),
    }
}

fn from_run(run: &IsoFlopPoint) -> FrontierPoint {
    FrontierPoint {
        flops: run.flops,
        params_nonvocab: run.params_nonvocab,
        params_vocab: run.params_vocab,
        n_vocab: run.n_vocab,
        loss_normalised: run.loss,
    }
}

fn check(run: &IsoFlopPoint) -> Result<(), FrontierError> {
    let positive = [
        ("flops", run.flops),
        ("params_nonvocab", run.params_nonvocab),
        ("params_vocab", run.params_vocab),
        ("n_vocab", run.n_vocab),
        ("tokens", run.tokens),
    ];
    let run_id = || run.run_id.clone();
    if let Some((field, value)) = positive.into_iter().find(|(_, v)| !(*v > 0.0 && v.is_finite())) {
        return Err(FrontierError::BadValue { run_id: run_id(), field, value });
    }
    let value = run.loss;
    value
        .is_finite()
        .then_some(())
        .ok_or_else(|| FrontierError::BadLoss { run_id: run_id(), value })
}
