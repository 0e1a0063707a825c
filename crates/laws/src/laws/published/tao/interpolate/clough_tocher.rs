//! A smooth surface over a mesh: cubic, with a gradient that does not jump (Clough and Tocher 1965).

use super::mesh::{Mesh, Place, difference};

/// The surface's value at a point; none outside the mesh.
///
/// A triangle is split at its centroid into three cubics in Bernstein's form (Farin 1986). Values
/// and gradients at the corners leave one control point for each edge, set so that the slope
/// across the edge is linear along it. Across means from this triangle's centroid to that of the
/// one beyond, so that both agree and no affine map changes the surface (Alfeld 1984); at the
/// mesh's border it means from the centroid to the edge's middle.
pub(super) fn value(
    mesh: &Mesh,
    values: &[f64],
    gradients: &[[f64; 2]],
    point: [f64; 2],
) -> Option<f64> {
    let place = mesh.locate(point)?;
    Some(Patch::new(mesh, values, gradients, &place).at(place.weights))
}

/// Control points of a triangle with corners 0, 1, 2 and centroid c.
struct Patch {
    /// At the corners: b_iii.
    corner: [f64; 3],
    /// On the edge from i to j, near i: b_iij; b_iii where j = i.
    edge: [[f64; 3]; 3],
    /// On the way from i to the centroid, near i: b_iic.
    spoke: [f64; 3],
    /// Inside the part across from k, at the edge's middle: b_ijc.
    middle: [f64; 3],
}

impl Patch {
    fn new(mesh: &Mesh, values: &[f64], gradients: &[[f64; 2]], place: &Place) -> Self {
        let t = place.corners;
        let corner = t.map(|i| values[i]);
        let rise = |i: usize, j: usize| {
            let e = difference(mesh.points[j], mesh.points[i]);
            gradients[i][0] * e[0] + gradients[i][1] * e[1]
        };
        let edge = t.map(|i| t.map(|j| values[i] + rise(i, j) / 3.0));
        let spoke = edge.map(|row| row.iter().sum::<f64>() / 3.0);
        let mut patch = Self { corner, edge, spoke, middle: [0.0; 3] };
        patch.middle = [0, 1, 2].map(|k| patch.across(k, direction(mesh, t, k)));
        patch
    }

    /// b_ijc such that the slope along `u`, quadratic on the edge across from corner k, is linear.
    fn across(&self, k: usize, u: [f64; 3]) -> f64 {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let at_i = u[0] * self.corner[i] + u[1] * self.edge[i][j] + u[2] * self.spoke[i];
        let at_j = u[0] * self.edge[j][i] + u[1] * self.corner[j] + u[2] * self.spoke[j];
        ((at_i + at_j) / 2.0 - u[0] * self.edge[i][j] - u[1] * self.edge[j][i]) / u[2]
    }

    /// The cubic of the part that the point with these weights in the triangle lies in.
    fn at(&self, weights: [f64; 3]) -> f64 {
        let k = (0..3).fold(0, |k, other| if weights[other] < weights[k] { other } else { k });
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let (a, b, c) = (weights[i] - weights[k], weights[j] - weights[k], 3.0 * weights[k]);
        let inner = [0, 1, 2].map(|i| self.inner(i));
        let centre = inner.iter().sum::<f64>() / 3.0;
        a * a * (a * self.corner[i] + 3.0 * (b * self.edge[i][j] + c * self.spoke[i]))
            + b * b * (b * self.corner[j] + 3.0 * (a * self.edge[j][i] + c * self.spoke[j]))
            + c * c * (c * centre + 3.0 * (a * inner[i] + b * inner[j]))
            + 6.0 * a * b * c * self.middle[k]
    }

    /// b_icc: the three parts meet smoothly where each is the mean of those around it.
    fn inner(&self, i: usize) -> f64 {
        (self.spoke[i] + self.middle[(i + 1) % 3] + self.middle[(i + 2) % 3]) / 3.0
    }
}

/// The direction across the edge from i to j, in barycentric coordinates of (i, j, centroid).
///
/// With q the weights of the far corner beyond the edge, the centroid there is
/// ((1 + q_i − q_k) i + (1 + q_j − q_k) j) / 3 + q_k c.
fn direction(mesh: &Mesh, corners: [usize; 3], k: usize) -> [f64; 3] {
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let Some(beyond) = mesh.left_of(corners[j], corners[i]) else {
        return [0.5, 0.5, -1.0];
    };
    let q = mesh.weights(corners, mesh.points[beyond]);
    [(1.0 + q[i] - q[k]) / 3.0, (1.0 + q[j] - q[k]) / 3.0, q[k] - 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const POINTS: [[f64; 2]; 6] =
        [[0.0, 0.0], [3.0, 0.2], [2.8, 3.1], [-0.2, 2.7], [1.2, 1.6], [1.9, 0.9]];

    proptest! {
        #[test]
        fn a_parabola_is_reproduced_anywhere(x in 0.1..2.6f64, y in 0.3..2.6f64) {
            let value_at = |[x, y]: [f64; 2]| 1.0 + x - 2.0 * y + 0.5 * x * x - x * y + 0.3 * y * y;
            let slope = |[x, y]: [f64; 2]| [1.0 + x - y, -2.0 - x + 0.6 * y];
            let mesh = Mesh::new(POINTS.to_vec()).unwrap();
            let found = value(&mesh, &POINTS.map(value_at), &POINTS.map(slope), [x, y]).unwrap();
            prop_assert!((found - value_at([x, y])).abs() < 1e-12);
        }

        #[test]
        fn the_slope_does_not_jump_anywhere(
            from in [0.2..2.5f64, 0.4..2.5f64],
            turn in 0.0..std::f64::consts::TAU,
            values in proptest::collection::vec(-1.0..1.0f64, 6),
            gradients in proptest::collection::vec([-1.0..1.0f64, -1.0..1.0f64], 6),
        ) {
            let mesh = Mesh::new(POINTS.to_vec()).unwrap();
            let along = |s: f64| [from[0] + s * turn.cos(), from[1] + s * turn.sin()];
            let at = |s: f64| value(&mesh, &values, &gradients, along(s));
            let step = 1e-4;
            let losses: Vec<f64> = (0..2000).map_while(|k| at(f64::from(k) * step)).collect();
            for w in losses.windows(3) {
                // The second difference is h² times the bend; a jump of the slope would make it h.
                prop_assert!((w[0] - 2.0 * w[1] + w[2]).abs() < 1e3 * step * step);
            }
        }
    }

    #[test]
    fn the_surface_goes_through_its_points() {
        let mesh = Mesh::new(POINTS.to_vec()).unwrap();
        let values = [1.0, -2.0, 0.5, 3.0, -1.0, 0.25];
        for (point, expected) in POINTS.iter().zip(values) {
            let found = value(&mesh, &values, &[[0.3, -0.4]; 6], *point).unwrap();
            assert!((found - expected).abs() < 1e-12);
        }
    }
}
