//! The parabola and the cubic in ln N_nv.
//!
//! Each size is represented by its best vocabulary (Hoffmann et al. 2022, approach 2, as ScaMo's
//! figures draw it). N_v, V and D at the minimum come from [`interpolate`].

use super::grid::{Grid, Scale, apart};
use super::interpolate;
use super::types::{Curvature, Located, MinimumFlag};
use crate::laws::input::cell::Size;
use crate::laws::input::method::MinimumMethod;
use crate::laws::maths::least_squares::{LeastSquares, least_squares};

/// How often a valley is moved to where its curve has the minimum.
const MOVES: usize = 4;

/// The minimum of the polynomial of `degree` 2 or 3 through the valley of a grid, which is moved until the
/// minimum lies at its middle.
pub(super) fn locate(method: MinimumMethod, degree: usize, grid: &Grid) -> Located {
    let mut centre = grid.best_size();
    let mut located = through(method, degree, grid, centre);
    for _ in 0..MOVES {
        let next = located.1.map_or(centre, |ln_size| nearest(grid, ln_size));
        if next == centre {
            break;
        }
        centre = next;
        located = through(method, degree, grid, centre);
    }
    located.0
}

/// The size nearest to a place.
fn nearest(grid: &Grid, ln_size: f64) -> usize {
    let off = |i: &usize| (grid.sizes[*i].best.params_nonvocab.ln() - ln_size).abs();
    (0..grid.sizes.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or_default()
}

/// The minimum of the polynomial through the valley round one size, and where it lies, inside or not.
fn through(
    method: MinimumMethod,
    degree: usize,
    grid: &Grid,
    centre: usize,
) -> (Located, Option<f64>) {
    let unfit =
        |reason, curvature| Located { minimum: grid.best_run(method, Some(reason)), curvature };
    let sizes = grid.valley(centre);
    if apart(sizes).count() <= degree {
        return (unfit(MinimumFlag::FewLevels, None), None);
    }
    let scale = Scale::over(sizes.iter().map(|size| size.best.params_nonvocab.ln()));
    let Some(fit) = polynomial(degree, sizes, scale) else {
        return (unfit(MinimumFlag::FewLevels, None), None);
    };
    let Some(z) = stationary(&fit.coefficients) else {
        return (unfit(MinimumFlag::NotConvex, None), None);
    };
    let at = Some(scale.value_at(z));
    let curvature = Some(curvature(&fit, z, grid.runs_of_a_cell()));
    if z.abs() >= 1.0 {
        return (unfit(MinimumFlag::NotBracketed, curvature), at);
    }
    let loss = powers(z, degree).iter().zip(&fit.coefficients).map(|(z, c)| z * c).sum();
    let minimum = interpolate::along_sizes(method, grid, sizes, (scale.value_at(z), loss));
    (Located { minimum, curvature }, at)
}

fn polynomial(degree: usize, sizes: &[Size], scale: Scale) -> Option<LeastSquares> {
    let unit = |size: &Size| scale.to_unit(size.best.params_nonvocab.ln());
    let rows: Vec<_> = sizes.iter().map(|size| powers(unit(size), degree)).collect();
    let losses: Vec<_> = sizes.iter().map(|size| size.best.loss).collect();
    least_squares(&rows, &losses)
}

fn powers(z: f64, degree: usize) -> Vec<f64> {
    (0..=degree).map(|power| z.powi(power as i32)).collect()
}

/// Where the polynomial has its local minimum; none where it has none.
///
/// For the cubic it is the root of c1 + 2 c2 z + 3 c3 z² with a positive second derivative, written
/// so that it neither cancels nor breaks down as c3 → 0.
fn stationary(c: &[f64]) -> Option<f64> {
    let (c1, c2) = (c[1], c[2]);
    let c3 = c.get(3).copied().unwrap_or(0.0);
    let discriminant = 4.0 * c2 * c2 - 12.0 * c1 * c3;
    if discriminant <= 0.0 || (c3 == 0.0 && c2 <= 0.0) {
        return None;
    }
    let root = discriminant.sqrt();
    Some(if c2 > 0.0 { -2.0 * c1 / (2.0 * c2 + root) } else { (root - 2.0 * c2) / (6.0 * c3) })
}

fn curvature(fit: &LeastSquares, z: f64, runs: f64) -> Curvature {
    let gradient = [0.0, 0.0, 2.0, 6.0 * z];
    let gradient = &gradient[..fit.coefficients.len()];
    let value = gradient.iter().zip(&fit.coefficients).map(|(g, c)| g * c).sum();
    Curvature { value, unit_error: fit.unit_error(gradient), rss: fit.rss, runs, dof: fit.dof }
}
