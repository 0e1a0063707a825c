//! The joint quadratic in (ln N_nv, ln N_v) over the cells of a budget's valley.
//!
//! L = c0 + c1 u + c2 v + c3 u² + c4 uv + c5 v², u and v being the two logarithms in units of half
//! their range. It places both optima between the levels tried and uses every vocabulary, where
//! the curves use the best of each size.

use super::grid::{Grid, Scale};
use super::types::{Curvature, Located, Minimum, MinimumFlag};
use crate::laws::input::cell::Cell;
use crate::laws::input::method::MinimumMethod;
use crate::laws::maths::least_squares::{LeastSquares, least_squares};
use crate::laws::maths::stats::extent;

const METHOD: MinimumMethod = MinimumMethod::Surface;

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
        minimum: Minimum { flags: flags.to_vec(), ..grid.best_run(METHOD, None) },
        curvature,
    };
    let cells = &grid.cells_of_valley()[..];
    let few = cells.len() < 6 || grid.sizes.len() < 3 || grid.n_vocabularies() < 3;
    let axes = Axes::over(cells);
    let Some(fit) = (if few { None } else { quadratic(cells, axes) }) else {
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

fn quadratic(cells: &[Cell], axes: Axes) -> Option<LeastSquares> {
    let rows: Vec<_> = cells.iter().map(|cell| terms(axes.of(cell)).to_vec()).collect();
    let losses: Vec<_> = cells.iter().map(|cell| cell.loss).collect();
    least_squares(&rows, &losses)
}

fn terms((u, v): (f64, f64)) -> [f64; 6] {
    [1.0, u, v, u * u, u * v, v * v]
}

/// Where the gradient vanishes; none unless the surface is convex.
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

/// The minimum at (u, v); what is not on the axes comes from planes in (u, v) through the cells,
/// D by way of ln D(N_nv + N_v) as for the curves.
fn interpolate(
    grid: &Grid,
    cells: &[Cell],
    (axes, (u, v)): (Axes, (f64, f64)),
    fit: &LeastSquares,
) -> Minimum {
    let plane = |value: fn(&Cell) -> f64| plane_at(cells, axes, (u, v), value);
    let params_nonvocab = axes.nonvocab.value_at(u).exp();
    let params_vocab = axes.vocab.value_at(v).exp();
    Minimum {
        method: METHOD,
        budget_flops: grid.budget_flops,
        flops: plane(|cell| cell.flops.ln()).exp(),
        params_nonvocab,
        params_vocab,
        n_vocab: params_vocab / plane(Cell::ln_width).exp(),
        tokens: plane(Cell::ln_work).exp() / (params_nonvocab + params_vocab),
        loss_normalised: terms((u, v)).iter().zip(&fit.coefficients).map(|(t, c)| t * c).sum(),
        ci95: None,
        flags: doubts(grid, params_nonvocab),
        trusted: false,
    }
}

/// The best vocabulary of a size beside the minimum is not what a surface leans on.
fn doubts(grid: &Grid, params_nonvocab: f64) -> Vec<MinimumFlag> {
    let all = grid.doubts_at(params_nonvocab.ln()).into_iter();
    all.filter(|flag| *flag != MinimumFlag::EdgeVocab).collect()
}

fn plane_at(cells: &[Cell], axes: Axes, at: (f64, f64), value: fn(&Cell) -> f64) -> f64 {
    let row = |(u, v): (f64, f64)| vec![1.0, u, v];
    let rows: Vec<_> = cells.iter().map(|cell| row(axes.of(cell))).collect();
    let values: Vec<_> = cells.iter().map(value).collect();
    let plane = least_squares(&rows, &values).expect("cells that fix a quadratic fix a plane");
    row(at).iter().zip(&plane.coefficients).map(|(x, c)| x * c).sum()
}

/// Which edges of the grid a minimum lies at or beyond.
fn outside(grid: &Grid, minimum: &Minimum, u: f64) -> Vec<MinimumFlag> {
    let [low, high] = extent(grid.cells.iter().map(|cell| cell.n_vocab));
    let beyond_sizes = u.abs() >= 1.0;
    let beyond_vocab = !(low < minimum.n_vocab && minimum.n_vocab < high);
    [(beyond_sizes, MinimumFlag::NotBracketed), (beyond_vocab, MinimumFlag::VocabNotBracketed)]
        .into_iter()
        .filter_map(|(is, flag)| is.then_some(flag))
        .collect()
}
