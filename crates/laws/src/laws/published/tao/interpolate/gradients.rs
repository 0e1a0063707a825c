//! Gradients at the points of a mesh, from the values there (Nielson 1983).

use super::mesh::{Mesh, difference};

/// When to stop improving the gradients.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Stop {
    /// The largest change in a sweep, relative to the gradient or to `least`.
    tolerance: f64,
    least: f64,
    sweeps: usize,
}

impl Stop {
    /// The rule of scipy's `griddata`.
    ///
    /// Its tolerance depends on units: a loss over raw parameters and characters has gradients
    /// near 1e-8, so that in the paper's interpolation it ends after the first sweep, short of the
    /// smoothest surface. The published frontier is that of one sweep.
    pub const PUBLISHED: Self = Self { tolerance: 1e-6, least: 1.0, sweeps: 400 };

    /// Until a sweep changes nothing that matters, in any units.
    pub const CONVERGED: Self = Self { tolerance: 1e-10, least: 0.0, sweeps: 4000 };
}

/// The gradients whose cubics along the edges bend least: of Σ ∫ (d²w/ds²)² ds over all edges, w
/// being the cubic with the values and the gradients' slopes at both ends.
///
/// For an edge e of length ℓ with the rise Δ the integral is, times ℓ³,
/// 4 (m0² + m0 m1 + m1²) − 12 Δ (m0 + m1) + 12 Δ², m = g·e at its ends. Each sweep sets the
/// gradient of every point in turn to the best for those of its neighbours (Gauss and Seidel),
/// starting from 0.
pub(super) fn estimate(mesh: &Mesh, values: &[f64], stop: Stop) -> Vec<[f64; 2]> {
    let neighbours = mesh.neighbours();
    let mut gradients = vec![[0.0; 2]; values.len()];
    for _ in 0..stop.sweeps {
        let mut change = 0.0f64;
        for i in 0..values.len() {
            let next = best_at(mesh, values, &gradients, i, &neighbours[i]);
            let moved = difference(next, gradients[i]).map(f64::abs);
            let size = next[0].abs().max(next[1].abs()).max(stop.least);
            if moved != [0.0, 0.0] {
                change = change.max(moved[0].max(moved[1]) / size);
            }
            gradients[i] = next;
        }
        if change < stop.tolerance {
            break;
        }
    }
    gradients
}

/// Solves Σ (8 g·e + 4 g'·e − 12 Δ) e / ℓ³ = 0 for g, the neighbours' g' being given.
fn best_at(
    mesh: &Mesh,
    values: &[f64],
    gradients: &[[f64; 2]],
    i: usize,
    neighbours: &[usize],
) -> [f64; 2] {
    let (mut xx, mut xy, mut yy, mut right) = (0.0, 0.0, 0.0, [0.0; 2]);
    for j in neighbours {
        let [x, y] = difference(mesh.points[*j], mesh.points[i]);
        let weight = x.hypot(y).powi(-3);
        let theirs = gradients[*j][0] * x + gradients[*j][1] * y;
        let pull = weight * (3.0 * (values[*j] - values[i]) - theirs) / 2.0;
        xx += weight * x * x;
        xy += weight * x * y;
        yy += weight * y * y;
        right = [right[0] + pull * x, right[1] + pull * y];
    }
    let determinant = xx * yy - xy * xy;
    [(yy * right[0] - xy * right[1]) / determinant, (xx * right[1] - xy * right[0]) / determinant]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slanted lattice, bent so that no four points lie on a circle.
    fn mesh() -> Mesh {
        let place = |i: usize| (f64::from(i as u32 % 4), f64::from(i as u32 / 4));
        Mesh::new((0..16).map(place).map(|(x, y)| [x + 0.1 * y * y, y + 0.07 * x * x]).collect())
            .unwrap()
    }

    #[test]
    fn a_plane_has_its_gradient_everywhere_after_enough_sweeps() {
        let mesh = mesh();
        let values: Vec<f64> = mesh.points.iter().map(|[x, y]| 3.0 - 2.0 * x + 0.5 * y).collect();
        for [x, y] in estimate(&mesh, &values, Stop::CONVERGED) {
            assert!((x + 2.0).abs() < 1e-8 && (y - 0.5).abs() < 1e-8, "{x} {y}");
        }
    }

    #[test]
    fn the_published_rule_ends_after_one_sweep_where_gradients_are_small() {
        let mesh = mesh();
        let values: Vec<f64> = mesh.points.iter().map(|[x, y]| 1e-8 * (x * x + y)).collect();
        let one = Stop { sweeps: 1, ..Stop::CONVERGED };
        let published = estimate(&mesh, &values, Stop::PUBLISHED);
        assert_eq!(published, estimate(&mesh, &values, one));
        assert_ne!(published, estimate(&mesh, &values, Stop::CONVERGED));
    }
}
