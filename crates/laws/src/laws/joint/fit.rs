//! Cells into the coefficients of a joint loss.

use super::problem::{Problem, noise_of};
use super::weighed::Cells;
use super::{Cost, JointLaw};
use crate::laws::maths::engine::{MOST_STEPS, minimise};
use crate::laws::minima::grid::Grid;
use crate::laws::minima::run_noise::RunNoise;

/// Degrees of freedom that the residuals are given, at least.
const FEWEST_FREE: f64 = 4.0;

/// The joint law through the cells of some budgets; none where they do not tell its coefficients.
///
/// Least squares over the cells by the runs that each is worth. Where the cells say little of a
/// coefficient it stays near what is expected of it: exponents near 0.4 within a factor of two, no
/// coupling. The expectations weigh as much as one run each, of standard deviation `noise`.
pub fn fit_joint(grids: &[Grid], noise: Option<RunNoise>, repeats: bool) -> Option<JointLaw> {
    let cells = Cells::new(grids);
    let terms = cells.terms(repeats)?;
    let problem = Problem::new(&cells, terms, noise);
    let values = problem.best(problem.starts())?;
    let rss = problem.of_cells(&values);
    let (n, p) = (cells.all.len(), terms.count());
    let free = problem.free(p);
    let finite = rss.is_finite() && values.iter().all(|value| value.is_finite());
    finite.then_some(())?;
    Some(JointLaw {
        cost: Cost::of(&cells.all)?,
        residual_sd: (rss / n as f64 / free).sqrt(),
        dof: (free * problem.effective_cells()).max(FEWEST_FREE) as usize,
        loss: problem.law(&values),
        bootstrap: Vec::new(),
        n,
    })
}

/// The coefficients through other losses of the same cells, downhill from those of `law`.
///
/// Cells count as those of `grids` do: weighed by the losses that were drawn, those that chance made low would
/// count more, and every replicate would lie below the law.
pub fn refitted(
    law: &JointLaw,
    (grids, drawn): (&[Grid], &[Grid]),
    noise: Option<RunNoise>,
) -> Vec<f64> {
    let cells = Cells::new(drawn);
    let mut problem = Problem::new(&cells, law.loss.terms, noise);
    problem.weights = Cells::new(grids).weights(noise_of(noise));
    problem.frame = law.loss.clone();
    minimise(&problem, law.loss.values.clone(), MOST_STEPS).0
}
