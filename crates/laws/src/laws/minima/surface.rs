//! The optimum in N_nv and N_v at once: a quadratic over a budget's valley, and a cross of its cells.
//!
//! L = c0 + c1 u + c2 v + c3 u² + c4 uv + c5 v², u and v being ln N_nv and ln N_v in units of half
//! their range. It places both optima between the levels tried and uses every vocabulary, where
//! the curves use the best of each size.
//!
//! A cross has sizes at one vocabulary and vocabularies at one size, too few cells for a quadratic.

use super::grid::{Grid, Scale};
use super::minimum::{Curvature, Located, Minimum, MinimumFlag, raised};
use crate::laws::input::{Cell, IsoFlopPoint, MinimumMethod, best_index, cells};
use crate::laws::maths::engine::least_squares_line;
use crate::laws::maths::stats::{distinct, extent};
use crate::laws::maths::{LeastSquares, least_squares};
use serde::{Deserialize, Serialize};

/// The two axes of the surface.
#[derive(Clone, Copy)]
struct Axes {
    nonvocab: Scale,
    vocab: Scale,
}

impl Axes {
    fn over(cells: &[Cell]) -> Self {
        Self {
            nonvocab: Scale::over(cells.iter().map(|cell| cell.params_nonvocab.ln())),
            vocab: Scale::over(cells.iter().map(|cell| cell.params_vocab.ln())),
        }
    }

    fn of(self, cell: &Cell) -> (f64, f64) {
        (
            self.nonvocab.to_unit(cell.params_nonvocab.ln()),
            self.vocab.to_unit(cell.params_vocab.ln()),
        )
    }
}

/// The minimum of the surface through a grid.
pub(super) fn locate(grid: &Grid) -> Located {
    let unfit = |flags: &[MinimumFlag], curvature| Located {
        minimum: Minimum { flags: flags.to_vec(), ..grid.best_run(MinimumMethod::Surface, None) },
        curvature,
    };
    let cells = &grid.cells_of_valley()[..];
    let few = cells.len() < 6 || grid.sizes.len() < 3 || grid.n_vocabularies() < 3;
    let axes = Axes::over(cells);
    let Some(fit) = (if few { None } else { through(cells, axes, quadratic, |cell| cell.loss) })
    else {
        return unfit(&[MinimumFlag::FewLevels], None);
    };
    let Some((u, v)) = stationary(&fit.coefficients) else {
        return unfit(&[MinimumFlag::NotConvex], None);
    };
    let curvature = Some(smallest_curvature(&fit, grid));
    let minimum = interpolate(grid, cells, (axes, (u, v)), &fit);
    let outside = outside(grid, &minimum, u);
    if outside.is_empty() {
        return Located { minimum, curvature };
    }
    unfit(&outside, curvature)
}

/// Least squares of a value of the cells in terms of their places.
fn through(
    cells: &[Cell],
    axes: Axes,
    terms: fn((f64, f64)) -> Vec<f64>,
    value: fn(&Cell) -> f64,
) -> Option<LeastSquares> {
    let rows: Vec<_> = cells.iter().map(|cell| terms(axes.of(cell))).collect();
    let values: Vec<_> = cells.iter().map(value).collect();
    least_squares(&rows, &values)
}

fn quadratic((u, v): (f64, f64)) -> Vec<f64> {
    vec![1.0, u, v, u * u, u * v, v * v]
}

/// The zero of the gradient; `None` unless the surface is convex.
fn stationary(c: &[f64]) -> Option<(f64, f64)> {
    let determinant = 4.0 * c[3] * c[5] - c[4] * c[4];
    if c[3] <= 0.0 || determinant <= 0.0 {
        return None;
    }
    let u = (c[4] * c[2] - 2.0 * c[5] * c[1]) / determinant;
    let v = (c[4] * c[1] - 2.0 * c[3] * c[2]) / determinant;
    Some((u, v))
}

/// The smaller eigenvalue of the Hessian, and its error with its direction held.
fn smallest_curvature(fit: &LeastSquares, grid: &Grid) -> Curvature {
    let c = &fit.coefficients;
    // The Hessian [[2 c3, c4], [c4, 2 c5]] is diagonal after a turn by `angle`.
    let angle = 0.5 * f64::atan2(2.0 * c[4], 2.0 * c[3] - 2.0 * c[5]);
    let (along, across) = (-angle.sin(), angle.cos());
    let gradient = [0.0, 0.0, 0.0, 2.0 * along.powi(2), 2.0 * along * across, 2.0 * across.powi(2)];
    let value = gradient.iter().zip(c).map(|(g, c)| g * c).sum();
    let runs = grid.runs_of_a_cell();
    Curvature { value, unit_error: fit.unit_error(&gradient), rss: fit.rss, runs, dof: fit.dof }
}

/// The minimum at (u, v); other quantities come from planes in (u, v) through the cells, D by way of
/// ln D(N_nv + N_v) as for the curves.
fn interpolate(
    grid: &Grid,
    cells: &[Cell],
    (axes, (u, v)): (Axes, (f64, f64)),
    fit: &LeastSquares,
) -> Minimum {
    let plane = |value: fn(&Cell) -> f64| -> f64 {
        let plane = through(cells, axes, |(u, v)| vec![1.0, u, v], value);
        let plane = plane.expect("cells that fix a quadratic fix a plane");
        [1.0, u, v].iter().zip(&plane.coefficients).map(|(x, c)| x * c).sum()
    };
    let params_nonvocab = axes.nonvocab.value_at(u).exp();
    let params_vocab = axes.vocab.value_at(v).exp();
    // A surface does not use the best vocabulary of neighbouring sizes.
    let doubts = grid.doubts_at(params_nonvocab.ln()).into_iter();
    Minimum {
        method: MinimumMethod::Surface,
        budget_flops: grid.budget_flops,
        flops: plane(|cell| cell.flops.ln()).exp(),
        params_nonvocab,
        params_vocab,
        n_vocab: params_vocab / plane(Cell::ln_width).exp(),
        tokens: plane(Cell::ln_work).exp() / (params_nonvocab + params_vocab),
        loss_normalised: quadratic((u, v)).iter().zip(&fit.coefficients).map(|(t, c)| t * c).sum(),
        ci95: None,
        flags: doubts.filter(|flag| *flag != MinimumFlag::EdgeVocab).collect(),
        trusted: false,
    }
}

/// The edges of the grid at or beyond which a minimum lies.
fn outside(grid: &Grid, minimum: &Minimum, u: f64) -> Vec<MinimumFlag> {
    let [low, high] = extent(grid.cells.iter().map(|cell| cell.n_vocab));
    let beyond_sizes = u.abs() >= 1.0;
    let beyond_vocab = !(low < minimum.n_vocab && minimum.n_vocab < high);
    raised([
        (beyond_sizes, MinimumFlag::NotBracketed),
        (beyond_vocab, MinimumFlag::VocabNotBracketed),
    ])
}

// A cross of cells.

/// The extent of the cells that test a forecast.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TriedCells {
    pub params_nonvocab: [f64; 2],
    pub params_vocab: [f64; 2],
}

/// The cells whose loss is within noise of the best one, which is included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TiedCells {
    pub params_nonvocab: [f64; 2],
    pub params_vocab: [f64; 2],
    pub tokens: [f64; 2],
    /// The range of the loss: two standard deviations around the best cell's mean.
    pub loss: [f64; 2],
}

/// The minimum of one budget by its cells.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CrossOptimum {
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    pub n_vocab: f64,
    /// D for the FLOPs of the best cell, by N_nv + N_v.
    pub tokens: f64,
}

/// The vertex of a parabola in ln N_nv through the vocabulary with the most sizes, and of one in ln V
/// through the size with the most vocabularies; none if neither has a vertex between its cells.
pub fn cross_optimum(points: &[IsoFlopPoint]) -> Option<CrossOptimum> {
    if points.is_empty() {
        return None;
    }
    let cells = cells(&Vec::from_iter(points));
    let best = &cells[best_index(&cells)];
    let sizes = longest(&cells, |cell| cell.n_vocab);
    let vocabularies = longest(&cells, |cell| cell.params_nonvocab);
    let size = vertex(&sizes, |cell| cell.params_nonvocab);
    let vocab = vertex(&vocabularies, |cell| cell.n_vocab);
    size.or(vocab)?;
    let params_nonvocab = size.unwrap_or(best.params_nonvocab);
    let n_vocab = vocab.unwrap_or(best.n_vocab);
    let params_vocab = n_vocab * width(&sizes, best, params_nonvocab);
    let tokens = best.ln_work().exp() / (params_nonvocab + params_vocab);
    Some(CrossOptimum { params_nonvocab, params_vocab, n_vocab, tokens })
}

/// The cells that tie with the best one; `None` if the noise is unknown, with neither repeated runs nor `run_sd`, the
/// standard deviation of a run from elsewhere. Tokenizer noise, common to the sizes of a vocabulary, is not counted.
pub fn tied_cells(points: &[IsoFlopPoint], run_sd: Option<f64>) -> Option<TiedCells> {
    let cells = cells(&Vec::from_iter(points));
    let spread: f64 = cells.iter().map(|cell| cell.spread).sum();
    let dof: usize = cells.iter().map(|cell| cell.dof).sum();
    let sd = if dof > 0 { Some((spread / dof as f64).sqrt()) } else { run_sd }?;
    let best = (!cells.is_empty()).then(|| &cells[best_index(&cells)])?;
    let is_tied = |cell: &&Cell| {
        cell.loss - best.loss <= 2.0 * sd * (1.0 / cell.runs + 1.0 / best.runs).sqrt()
    };
    let tied = Vec::from_iter(cells.iter().filter(is_tied));
    let range = |of: fn(&Cell) -> f64| extent(tied.iter().map(|cell| of(cell)));
    let around = 2.0 * sd / best.runs.sqrt();
    Some(TiedCells {
        params_nonvocab: range(|cell| cell.params_nonvocab),
        params_vocab: range(|cell| cell.params_vocab),
        tokens: range(|cell| cell.tokens),
        loss: [best.loss - around, best.loss + around],
    })
}

/// The cells of the value that most cells share.
fn longest(cells: &[Cell], value: impl Fn(&Cell) -> f64) -> Vec<&Cell> {
    let sharing = |of: f64| Vec::from_iter(cells.iter().filter(|cell| value(cell) == of));
    distinct(cells.iter().map(&value))
        .into_iter()
        .map(sharing)
        .max_by_key(Vec::len)
        .unwrap_or_default()
}

/// The vertex of a parabola in ln x through the losses of at least three cells, if it lies between them.
fn vertex(cells: &[&Cell], x: impl Fn(&Cell) -> f64) -> Option<f64> {
    if cells.len() < 3 || cells.iter().any(|cell| x(cell) <= 0.0) {
        return None;
    }
    let scale = Scale::over(cells.iter().map(|cell| x(cell).ln()));
    let row = |cell: &&Cell| {
        let z = scale.to_unit(x(cell).ln());
        vec![1.0, z, z * z]
    };
    let rows = Vec::from_iter(cells.iter().map(row));
    let losses = Vec::from_iter(cells.iter().map(|cell| cell.loss));
    let [_, slope, bend] = least_squares(&rows, &losses)?.coefficients[..] else { return None };
    let z = -slope / (2.0 * bend);
    (bend > 0.0 && z.abs() < 1.0).then(|| scale.value_at(z).exp())
}

/// d = N_v/V at N_nv, by a line in logarithms through the sizes, or from the best cell.
fn width(sizes: &[&Cell], best: &Cell, params_nonvocab: f64) -> f64 {
    if !best.has_vocabulary() {
        return 0.0;
    }
    let of = |f: fn(&Cell) -> f64| Vec::from_iter(sizes.iter().map(|cell| f(cell)));
    let ln_sizes = of(|cell| cell.params_nonvocab.ln());
    let line = least_squares_line(&ln_sizes, &of(Cell::ln_width), &vec![1.0; sizes.len()]);
    line.map_or(best.ln_width(), |line| line.at(params_nonvocab.ln())).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::input::{Metric, RunFacts};

    /// A cell of 1e12 FLOPs whose loss is least at N_nv = 10,000 and V = 4000; d = √N_nv / 5.
    fn point(params_nonvocab: f64, n_vocab: f64) -> IsoFlopPoint {
        let params_vocab = n_vocab * params_nonvocab.sqrt() / 5.0;
        let (n, v) = ((params_nonvocab / 1e4).ln(), (n_vocab / 4e3).ln());
        IsoFlopPoint {
            run_id: format!("{params_nonvocab} {n_vocab}"),
            seed: 0,
            budget_flops: 1e12,
            flops: 1e12,
            params_nonvocab,
            params_vocab,
            n_vocab,
            tokens: 1e12 / 6.0 / (params_nonvocab + params_vocab),
            metric: Metric::default(),
            loss: -5.0 + 0.1 * n * n + 0.3 * v * v,
            weight: 1.0,
            about: RunFacts::default(),
        }
    }

    const SIZES: [f64; 3] = [7e3, 13e3, 20e3];

    #[test]
    fn the_optimum_lies_between_the_cells_where_a_parabola_has_it() {
        let cross = [point(13e3, 2e3), point(13e3, 9e3)];
        let points = Vec::from_iter(SIZES.map(|size| point(size, 4.5e3)).into_iter().chain(cross));
        let found = cross_optimum(&points).unwrap();
        let near = |found: f64, truth: f64| assert!((found / truth - 1.0).abs() < 1e-6, "{found}");
        near(found.params_nonvocab, 1e4);
        near(found.n_vocab, 4e3);
        near(found.params_vocab, 4e3 * 20.0);
        near(found.tokens, 1e12 / 6.0 / 9e4);
    }

    #[test]
    fn cells_tie_with_the_best_one_within_the_noise() {
        let points = SIZES.map(|size| point(size, 4e3));
        let sizes = |sd| tied_cells(&points, Some(sd)).unwrap().params_nonvocab;
        // Losses of 0.0127, 0.0069 and 0.0480 above the least.
        assert_eq!(sizes(1e-4), [13e3, 13e3]);
        assert_eq!(sizes(3e-3), [7e3, 13e3]);
        assert_eq!(sizes(0.05), [7e3, 20e3]);
        assert_eq!(tied_cells(&points, None), None);
        // Two runs of each cell, 0.02 apart, know it themselves.
        let again = |(i, run): (usize, &IsoFlopPoint)| {
            let moved =
                |loss: f64| IsoFlopPoint { loss: run.loss + loss, seed: i as u64, ..run.clone() };
            [moved(-0.01), moved(0.01)]
        };
        let twice = Vec::from_iter(points.iter().enumerate().flat_map(again));
        assert_eq!(tied_cells(&twice, None).unwrap().params_nonvocab, [7e3, 13e3]);
    }

    #[test]
    fn one_vocabulary_keeps_it_and_an_end_is_no_vertex() {
        let found = cross_optimum(&SIZES.map(|size| point(size, 4.5e3))).unwrap();
        assert_eq!(found.n_vocab, 4.5e3);
        assert_eq!(cross_optimum(&SIZES.map(|size| point(2.0 * size, 4.5e3))), None);
        assert_eq!(cross_optimum(&[7e3, 13e3].map(|size| point(size, 4e3))), None);
        assert_eq!(cross_optimum(&[]), None);
    }
}
