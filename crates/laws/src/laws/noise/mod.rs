//! The noise of losses: of one run, of tokenizers and of test splits.

mod shared;

pub(super) use shared::{OtherClips, runs_beside_tokenizers, test_noise, tokenizer_noise};
pub use shared::{TestNoise, TokenizerNoise};

use crate::laws::input::Cell;
use crate::laws::maths::stats::{chi_square_tail, distinct};
use crate::laws::maths::{LeastSquares, least_squares};
use crate::laws::minima::{Grid, NoiseSource, RunNoise, Scale};

/// How runs, tokenizers and test splits scatter.
#[derive(Clone, Copy)]
pub(super) struct Scatter<'a> {
    pub noise: Option<RunNoise>,
    pub tokenizers: Option<&'a TokenizerNoise>,
    pub test: Option<&'a TestNoise>,
}

/// Share of a loss that rounding in means and fits may leave.
const ROUNDING: f64 = 1e-13;

/// The standard deviation of one run, pooled over the budgets; `None` with fewer than two degrees of freedom.
///
/// A run of weight w counts as w runs in a mean; all runs have the same noise.
///
/// If cells have several runs, it is the scatter around the cell's mean; only in the better half of each budget's cells
/// if the other half scatters more, as runs of few steps and diverged runs do. Otherwise it is the scatter of the
/// cells around a smooth surface over each budget's grid ([`of_surface`]), unless runs with several tokenizers give
/// it: `beside`.
pub(super) fn run_noise(grids: &[Grid], beside: Option<RunNoise>) -> Option<RunNoise> {
    let seeds = of_seeds(grids);
    if seeds.dof >= ENOUGH {
        return Some(seeds);
    }
    let known = [Some(seeds), of_surface(grids)].into_iter().flatten();
    let own = known.filter(|noise| noise.dof >= FEWEST_DOF).max_by_key(|noise| noise.dof);
    let by_seeds = own.is_some_and(|noise| noise.source == NoiseSource::Seeds);
    if by_seeds { own } else { beside.filter(|noise| noise.dof >= ENOUGH).or(own) }
}

impl RunNoise {
    /// Whether the scatter is no more than the rounding of the losses.
    pub(super) fn is_rounding(&self, grids: &[Grid]) -> bool {
        let losses = grids.iter().flat_map(|grid| &grid.cells).map(|cell| cell.loss.abs());
        self.sd <= ROUNDING * losses.fold(0.0, f64::max)
    }
}

// By the seeds of each cell.

/// Seeds are preferred to the surface from this many degrees of freedom on; with fewer, whichever
/// has more. So many are asked of several tokenizers too.
const ENOUGH: usize = 10;
/// The chance below which cells far from the minimum count as noisier than those near it.
const MORE_NOISE: f64 = 0.01;

/// All cells if they scatter equally; the better half of each budget's if the others scatter more.
fn of_seeds(grids: &[Grid]) -> RunNoise {
    let halves = grids.iter().map(halves);
    let (better, worse): (Vec<AroundMeans>, Vec<AroundMeans>) = halves.unzip();
    let (better, worse) = (sum(&better), sum(&worse));
    if better.dof >= ENOUGH && worse.exceeds(better) {
        better.noise()
    } else {
        sum(&[better, worse]).noise()
    }
}

/// The better and the worse half of a budget's cells.
fn halves(grid: &Grid) -> (AroundMeans, AroundMeans) {
    let mut cells: Vec<&Cell> = grid.cells.iter().collect();
    cells.sort_by(|a, b| a.loss.total_cmp(&b.loss));
    let (better, worse) = cells.split_at(cells.len().div_ceil(2));
    (AroundMeans::of(better), AroundMeans::of(worse))
}

fn sum(parts: &[AroundMeans]) -> AroundMeans {
    AroundMeans {
        squares: parts.iter().map(|part| part.squares).sum(),
        dof: parts.iter().map(|part| part.dof).sum(),
    }
}

/// How runs lie around the means of their cells.
#[derive(Clone, Copy)]
struct AroundMeans {
    squares: f64,
    dof: usize,
}

impl AroundMeans {
    fn of(cells: &[&Cell]) -> Self {
        let squares = cells.iter().map(|cell| cell.spread).sum();
        Self { squares, dof: cells.iter().map(|cell| cell.dof).sum() }
    }

    fn variance(self) -> f64 {
        self.squares / (self.dof as f64).max(1.0)
    }

    /// Whether it is larger than chance lets two scatters of the same noise be.
    fn exceeds(self, other: Self) -> bool {
        let chi2 = self.squares / other.variance();
        self.dof > 0 && chi_square_tail(chi2, self.dof, other.dof) < MORE_NOISE
    }

    fn noise(self) -> RunNoise {
        RunNoise { sd: self.variance().sqrt(), dof: self.dof, source: NoiseSource::Seeds }
    }
}

// From the residuals of a smooth surface through the cells.

/// Fewer degrees of freedom say nothing about a standard deviation.
const FEWEST_DOF: usize = 2;
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
fn of_surface(grids: &[Grid]) -> Option<RunNoise> {
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

/// The polynomial of one degree through a grid, cells weighted by their runs; `None` if it has no residual or the
/// cells do not determine it.
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

/// x^i; 1 for i = 0 even if a single level leaves x undefined.
fn power(x: f64, i: i32) -> f64 {
    if i == 0 { 1.0 } else { x.powi(i) }
}

fn levels(cells: &[Cell], of: fn(&Cell) -> f64) -> usize {
    distinct(cells.iter().map(of)).len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::input::group_budgets;
    use crate::laws::simulated::Simulated;

    const SWEEP: Simulated = Simulated {
        budgets: &[1e15, 1e16, 1e17],
        n_sizes: 7,
        off_centre: 0.1,
        vocabularies: &[4096.0, 8192.0, 16384.0, 32768.0, 65536.0],
        n_seeds: 1,
        noise: 0.01,
        seed: 4,
    };

    fn noise_of(sweep: Simulated) -> Option<RunNoise> {
        let points = sweep.points();
        let budgets = group_budgets(&points).unwrap();
        run_noise(&budgets.iter().filter_map(Grid::new).collect::<Vec<_>>(), None)
    }

    #[test]
    fn the_noise_of_a_sweep_is_recovered_with_and_without_seeds() {
        for (noise, n_seeds) in [(0.003, 1), (0.03, 1), (0.003, 3), (0.03, 3)] {
            let found = noise_of(Simulated { noise, n_seeds, ..SWEEP }).unwrap();
            assert_eq!(found.source == NoiseSource::Seeds, n_seeds == 3);
            assert!((found.sd / noise - 1.0).abs() < 0.15, "{found:?} for {noise}");
        }
    }

    #[test]
    fn cells_that_diverge_say_nothing_of_the_noise_beside_the_minimum() {
        let mut points = Simulated { n_seeds: 3, ..SWEEP }.points();
        let worst = points.iter().map(|point| point.loss).fold(f64::MIN, f64::max);
        let astray = points.iter_mut().find(|point| point.loss == worst).unwrap();
        astray.loss += 2.0;
        let budgets = group_budgets(&points).unwrap();
        let grids: Vec<Grid> = budgets.iter().filter_map(Grid::new).collect();
        let found = run_noise(&grids, None).unwrap();
        assert!((found.sd / SWEEP.noise - 1.0).abs() < 0.15, "{found:?}");
    }

    #[test]
    fn the_shape_of_the_surface_is_not_taken_for_noise() {
        let found = noise_of(Simulated { noise: 0.0, ..SWEEP }).unwrap();
        assert!(found.sd < 2e-4, "{found:?}");
    }

    #[test]
    fn too_few_runs_know_no_noise() {
        assert_eq!(noise_of(Simulated { n_sizes: 3, vocabularies: &[8192.0], ..SWEEP }), None);
        let four = noise_of(Simulated { n_sizes: 4, vocabularies: &[8192.0], ..SWEEP }).unwrap();
        assert_eq!(four.dof, 3);
    }
}
