//! The noise of a run by what a smooth surface through the cells leaves.

use crate::laws::input::cell::Cell;
use crate::laws::maths::least_squares::{LeastSquares, least_squares};
use crate::laws::maths::stats::distinct;
use crate::laws::minima::grid::{Grid, Scale};
use crate::laws::minima::run_noise::{NoiseSource, RunNoise};

/// Fewer degrees of freedom say nothing about a standard deviation.
pub(super) const FEWEST_DOF: usize = 2;
/// Residuals that a surface of more than the second degree must leave.
const ENOUGH_RESIDUALS: usize = 10;
/// The degrees of the surfaces that are compared.
const DEGREES: std::ops::RangeInclusive<usize> = 2..=5;

/// The polynomials in (ln N_nv, ln V) through the cells of every budget's valley, of the one degree whose residual
/// variance RSS/dof over all budgets is the smallest.
///
/// Too low a degree takes the surface's shape for noise. A criterion made for prediction, such as
/// Akaike's, prefers such a degree as long as the misfit is smaller than the noise of further
/// coefficients: in simulated sweeps (`docs/coverage.md`) it overstated the noise by 12 %, and the
/// smallest variance was right to 2 %. Being a minimum it errs low where few residuals are left, so
/// a degree above the quadratic must leave ten.
pub(super) fn of_surface(grids: &[Grid]) -> Option<RunNoise> {
    let pooled = DEGREES.filter_map(|degree| {
        let residuals = grids.iter().filter_map(|grid| highest(grid, degree));
        let (rss, dof) = residuals.fold((0.0, 0), |(rss, dof), r| (rss + r.rss, dof + r.dof));
        let enough = dof >= if degree == *DEGREES.start() { FEWEST_DOF } else { ENOUGH_RESIDUALS };
        let source = NoiseSource::Surface { degree };
        enough.then(|| RunNoise { sd: (rss / dof as f64).sqrt(), dof, source })
    });
    pooled.min_by(|a, b| a.sd.total_cmp(&b.sd))
}

/// The fit of the highest degree up to `degree` that leaves residuals.
fn highest(grid: &Grid, degree: usize) -> Option<LeastSquares> {
    (*DEGREES.start()..=degree).rev().find_map(|degree| polynomial(grid, degree))
}

/// The polynomial of one degree through a grid, cells weighted by their runs; none where it leaves
/// no residual or the cells do not fix it.
fn polynomial(grid: &Grid, degree: usize) -> Option<LeastSquares> {
    let cells = grid.cells_of_valley();
    let basis = Basis::over(&cells, degree);
    let weight = |cell: &Cell| cell.runs.sqrt();
    let row = |cell| basis.terms(cell).map(|term| term * weight(cell)).collect();
    let rows: Vec<Vec<f64>> = cells.iter().map(row).collect();
    let losses: Vec<f64> = cells.iter().map(|cell| cell.loss * weight(cell)).collect();
    least_squares(&rows, &losses).filter(|fit| fit.dof > 0)
}

/// The monomials u^i v^j of i + j ≤ degree, u and v being ln N_nv and ln V in units of half their
/// range, and i and j below the number of levels of each.
struct Basis {
    nonvocab: Scale,
    vocab: Option<Scale>,
    powers: Vec<[i32; 2]>,
}

impl Basis {
    fn over(cells: &[Cell], degree: usize) -> Self {
        let sizes = levels(cells, |cell| cell.params_nonvocab);
        let vocabularies = levels(cells, |cell| cell.n_vocab);
        let up_to = |levels: usize| 0..=degree.min(levels - 1) as i32;
        let pairs = up_to(sizes).flat_map(|i| up_to(vocabularies).map(move |j| [i, j]));
        Self {
            nonvocab: Scale::over(cells.iter().map(|cell| cell.params_nonvocab.ln())),
            vocab: (vocabularies > 1).then(|| Scale::over(cells.iter().map(|c| c.n_vocab.ln()))),
            powers: pairs.filter(|[i, j]| i + j <= degree as i32).collect(),
        }
    }

    fn terms(&self, cell: &Cell) -> impl Iterator<Item = f64> {
        let u = self.nonvocab.to_unit(cell.params_nonvocab.ln());
        let v = self.vocab.map_or(0.0, |scale| scale.to_unit(cell.n_vocab.ln()));
        self.powers.iter().map(move |[i, j]| power(u, *i) * power(v, *j))
    }
}

/// x^i, 1 for i = 0 even where a single level leaves x undefined.
fn power(x: f64, i: i32) -> f64 {
    if i == 0 { 1.0 } else { x.powi(i) }
}

fn levels(cells: &[Cell], of: fn(&Cell) -> f64) -> usize {
    distinct(cells.iter().map(of)).len()
}
