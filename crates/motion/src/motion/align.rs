//! The rotation that lays one set of vectors on another: least squares by quaternions.

use crate::motion::Quat;

/// A symmetric matrix of quaternion products.
type Quadratic = [[f64; 4]; 4];

/// Squarings after which an eigenvalue a millionth below the largest is gone.
const SQUARINGS: usize = 24;

/// The rotation `R` with the least `Σ ‖R from_i − to_i‖²`, the one nearest to `prior` among equals.
///
/// The quaternion is an eigenvector to the largest eigenvalue of a 4 × 4 matrix of the vectors'
/// products (Horn 1987, "Closed-form solution of absolute orientation using unit quaternions").
/// `prior` is projected onto the space of those eigenvectors: where the vectors leave the rotation
/// open, as vectors on one line or without length do, the open part is that of `prior`. The sign is
/// that of `prior` too, so that rotations of neighbouring frames are neighbours.
///
/// # Panics
/// If the slices differ in length.
pub fn align(from: &[[f64; 3]], to: &[[f64; 3]], prior: Quat) -> Quat {
    assert_eq!(from.len(), to.len(), "every vector has its partner");
    let projector = dominant(shifted(products(from, to)));
    let projected = apply(&projector, prior);
    // A prior at right angles to the solution says nothing: any column of the projector does.
    let columns = projector.into_iter().chain([prior]);
    let mut solutions = [projected].into_iter().chain(columns);
    solutions.find_map(normalised).unwrap_or(prior)
}

/// Horn's matrix: `qᵀ N q = Σ to_i · R(q) from_i`.
fn products(from: &[[f64; 3]], to: &[[f64; 3]]) -> Quadratic {
    let s = |a: usize, b: usize| from.iter().zip(to).map(|(p, q)| p[a] * q[b]).sum::<f64>();
    let (xx, yy, zz) = (s(0, 0), s(1, 1), s(2, 2));
    let (x, y, z) = (s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0));
    let (xy, yz, zx) = (s(0, 1) + s(1, 0), s(1, 2) + s(2, 1), s(2, 0) + s(0, 2));
    [
        [xx + yy + zz, x, y, z],
        [x, xx - yy - zz, xy, zx],
        [y, xy, yy - xx - zz, yz],
        [z, zx, yz, zz - xx - yy],
    ]
}

/// The same eigenvectors, with eigenvalues from 0 on.
fn shifted(mut n: Quadratic) -> Quadratic {
    let norm = n.as_flattened().iter().map(|c| c * c).sum::<f64>().sqrt();
    (0..4).for_each(|i| n[i][i] += norm);
    n
}

/// The projector onto the eigenvectors to the largest eigenvalue, but for a factor.
fn dominant(mut n: Quadratic) -> Quadratic {
    for _ in 0..SQUARINGS {
        let trace: f64 = (0..4).map(|i| n[i][i]).sum();
        if trace <= f64::MIN_POSITIVE {
            // Vectors without length leave everything open.
            return std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
        }
        let scaled = n.map(|row| row.map(|c| c / trace));
        n = scaled.map(|row| apply(&scaled, row));
    }
    n
}

/// A symmetric matrix times a vector.
fn apply(n: &Quadratic, v: Quat) -> Quat {
    n.map(|row| (0..4).map(|i| row[i] * v[i]).sum())
}

fn normalised(q: Quat) -> Option<Quat> {
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    (length > 1e-6).then(|| q.map(|c| c / length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::rotate;
    use proptest::prelude::*;

    const NO_ROTATION: Quat = [1.0, 0.0, 0.0, 0.0];
    const X: [f64; 3] = [1.0, 0.0, 0.0];

    fn quat() -> impl Strategy<Value = Quat> {
        prop::array::uniform4(-1.0..1.0f64).prop_filter_map("has a length", normalised)
    }

    fn cosine(a: Quat, b: Quat) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    proptest! {
        #[test]
        fn the_rotation_of_a_body_is_found_with_the_sign_of_the_prior(q in quat(), prior in quat()) {
            let body = [[0.1, -0.08, 0.0], [-0.11, -0.07, 0.01], [0.0, 0.12, -0.02]];
            let found = align(&body, &body.map(|bone| rotate(q, bone)), prior);
            prop_assert!(cosine(found, q).abs() > 1.0 - 1e-9, "{found:?} is not {q:?}");
            prop_assert!(cosine(found, prior) > -1e-6);
        }

        #[test]
        fn one_bone_takes_the_smallest_rotation(q in quat()) {
            let found = align(&[X], &[rotate(q, X)], NO_ROTATION);
            let to = rotate(found, X);
            prop_assert!((0..3).all(|c| (to[c] - rotate(q, X)[c]).abs() < 1e-9));
            // The axis of the smallest rotation is at right angles to the bone.
            prop_assert!(found[1].abs() < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn a_bone_turned_right_round_is_laid_on_its_opposite() {
        let found = align(&[X], &[[-2.0, 0.0, 0.0]], NO_ROTATION);
        assert!((rotate(found, X)[0] + 1.0).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn bones_without_length_keep_the_prior() {
        let prior = [0.6, 0.0, 0.8, 0.0];
        assert_eq!(align(&[[0.0; 3]; 3], &[X; 3], prior), prior);
    }
}
