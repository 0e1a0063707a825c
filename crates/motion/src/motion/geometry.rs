//! Vectors of three numbers, unit quaternions `[w, x, y, z]` and turns about the vertical, as little as
//! kinematics needs.

use std::ops::{Add, Mul, Sub};

/// A place or a direction in double precision.
pub type Point = [f64; 3];

#[inline]
pub fn add<T: Copy + Add<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline]
pub fn sub<T: Copy + Sub<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
pub fn scale<T: Copy + Mul<Output = T>>(a: [T; 3], k: T) -> [T; 3] {
    a.map(|c| c * k)
}

#[inline]
pub fn dot<T: Copy + Add<Output = T> + Mul<Output = T>>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub fn cross<T: Copy + Sub<Output = T> + Mul<Output = T>>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn norm(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// `a` with the given length; `None` if it has no direction.
pub fn with_length(a: Point, length: f64) -> Option<Point> {
    let own = norm(a);
    (own > 1e-9).then(|| scale(a, length / own))
}

// Rotations.

/// A unit quaternion `[w, x, y, z]`.
pub type Quat = [f64; 4];

/// The rotation that turns nothing.
pub const NO_ROTATION: Quat = [1.0, 0.0, 0.0, 0.0];

/// Below this squared length a direction has no meaning in double precision.
const TINY: f64 = 1e-24;

/// The product `a b`: first `b` is applied, then `a`.
#[inline]
pub fn multiply(a: Quat, b: Quat) -> Quat {
    let ([aw, ax, ay, az], [bw, bx, by, bz]) = (a, b);
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

/// The inverse of a unit quaternion.
#[inline]
pub fn conjugate([w, x, y, z]: Quat) -> Quat {
    [w, -x, -y, -z]
}

/// `v` turned by `q`: `v + 2w(u × v) + 2u × (u × v)` with `q = (w, u)`.
pub fn rotate(q: Quat, v: Point) -> Point {
    let u = [q[1], q[2], q[3]];
    let c = cross(u, v);
    let cc = cross(u, c);
    std::array::from_fn(|i| v[i] + 2.0 * (q[0] * c[i] + cc[i]))
}

/// The shortest rotation that takes the direction of `from`, a unit vector along an axis, to `to`.
///
/// `q ∝ (1 + u·v, u × v)` with `v` the unit vector along `to`. For opposite vectors, where every
/// axis would do, the half-turn is about x, or about y if `from` lies along x: mirroring the
/// vectors then mirrors the rotation. A `to` without length gives `None`.
#[inline]
pub fn between(from: Point, to: Point) -> Option<Quat> {
    let squared = dot(to, to);
    if squared < TINY {
        return None;
    }
    let to = to.map(|c| c / squared.sqrt());
    let [x, y, z] = cross(from, to);
    let q = [1.0 + dot(from, to), x, y, z];
    let squared: f64 = q.iter().map(|c| c * c).sum();
    if squared < TINY {
        let along_x = from[0] != 0.0;
        return Some(if along_x { [0.0, 0.0, 1.0, 0.0] } else { [0.0, 1.0, 0.0, 0.0] });
    }
    let scale = 1.0 / squared.sqrt();
    Some(q.map(|c| c * scale))
}

/// The first column of the rotation matrix, then the second (Zhou et al. 2019).
#[inline]
pub fn to_6d([w, x, y, z]: Quat) -> [f32; 6] {
    let columns = [
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y + w * z),
        2.0 * (x * z - w * y),
        2.0 * (x * y - w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z + w * x),
    ];
    columns.map(|c| c as f32)
}

/// A turn about the vertical: the quaternion `(w, 0, y, 0)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Yaw {
    /// Cosine of half the angle.
    pub w: f64,
    /// Sine of half the angle.
    pub y: f64,
}

impl Yaw {
    /// No turn.
    pub const IDENTITY: Yaw = Yaw { w: 1.0, y: 0.0 };

    /// The turn by twice `half_angle` radians, as feature 0 adds up.
    pub fn from_half_angle(half_angle: f64) -> Yaw {
        Yaw { w: half_angle.cos(), y: half_angle.sin() }
    }

    /// The turn that makes a body facing `(x, z)` face +z, of any length but zero.
    ///
    /// Half-angle formulas on the larger component keep it exact for a body facing -z.
    pub fn to_face_z(x: f64, z: f64) -> Option<Yaw> {
        let length = x.hypot(z);
        if length * length < TINY {
            return None;
        }
        let (x, z) = (x / length, z / length);
        if z >= 0.0 {
            let w = ((1.0 + z) / 2.0).sqrt();
            return Some(Yaw { w, y: -x / (2.0 * w) });
        }
        let y = ((1.0 - z) / 2.0).sqrt().copysign(-x);
        Some(Yaw { w: -x / (2.0 * y), y })
    }

    /// The turn back.
    #[inline]
    pub fn inverse(self) -> Yaw {
        Yaw { w: self.w, y: -self.y }
    }

    /// The same turn with the quaternion's other sign.
    pub fn negated(self) -> Yaw {
        Yaw { w: -self.w, y: -self.y }
    }

    /// Cosine of half the angle between two turns.
    pub fn dot(self, other: Yaw) -> f64 {
        self.w * other.w + self.y * other.y
    }

    /// Half the angle from this turn to `next`: the arcsine of the y part of `next self⁻¹`.
    pub fn half_step_to(self, next: Yaw) -> f64 {
        (next.y * self.w - next.w * self.y).clamp(-1.0, 1.0).asin()
    }

    /// The horizontal vector `(x, z)` turned.
    #[inline]
    pub fn rotate_xz(self, x: f64, z: f64) -> (f64, f64) {
        let (sin, cos) = (2.0 * self.w * self.y, self.w * self.w - self.y * self.y);
        (cos * x + sin * z, cos * z - sin * x)
    }

    /// The point `p` turned about the vertical through the origin.
    #[inline]
    pub fn rotate(self, [px, py, pz]: [f32; 3]) -> [f32; 3] {
        let (x, z) = self.rotate_xz(f64::from(px), f64::from(pz));
        [x as f32, py, z as f32]
    }

    /// The quaternion `(w, 0, y, 0)`.
    #[inline]
    pub fn quat(self) -> Quat {
        [self.w, 0.0, self.y, 0.0]
    }
}

// The rotation that lays one set of vectors on another: least squares by quaternions.

/// A symmetric matrix of quaternion products.
type Quadratic = [[f64; 4]; 4];

/// Squarings after which an eigenvalue a millionth below the largest is gone.
const SQUARINGS: usize = 24;

/// The rotation `R` with the least `Σ ‖R from_i − to_i‖²`, the one nearest to `prior` among equals.
///
/// The quaternion is an eigenvector to the largest eigenvalue of a 4 × 4 matrix of the vectors'
/// products (Horn 1987, "Closed-form solution of absolute orientation using unit quaternions").
/// `prior` is projected onto the space of those eigenvectors: if the vectors do not determine the rotation (they lie on
/// one line or have no length), the rest comes from `prior`. The sign also follows `prior`, so that rotations of
/// neighbouring frames are close.
///
/// # Panics
/// If the slices differ in length.
pub fn align(from: &[Point], to: &[Point], prior: Quat) -> Quat {
    assert_eq!(from.len(), to.len(), "every vector has its partner");
    let projector = dominant(shifted(products(from, to)));
    let projected = apply(&projector, prior);
    // A prior at right angles to the solution says nothing: any column of the projector does.
    let columns = projector.into_iter().chain([prior]);
    let mut solutions = [projected].into_iter().chain(columns);
    solutions.find_map(normalised).unwrap_or(prior)
}

/// Horn's matrix: `qᵀ N q = Σ to_i · R(q) from_i`.
fn products(from: &[Point], to: &[Point]) -> Quadratic {
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
    use crate::motion::fixtures::from_6d;
    use proptest::prelude::*;

    const AXES: [Point; 4] = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];

    fn assert_close(a: Point, b: Point) {
        for i in 0..3 {
            assert!((a[i] - b[i]).abs() < 1e-6, "{a:?} is not {b:?}");
        }
    }

    fn direction() -> impl Strategy<Value = Point> {
        prop::array::uniform3(-1.0..1.0f64).prop_filter("has a length", |v| dot(*v, *v) > 1e-3)
    }

    #[test]
    fn opposite_directions_are_joined_by_a_half_turn() {
        for axis in AXES {
            let q = between(axis, axis.map(|c| -2.0 * c)).expect("a direction");
            assert_close(rotate(q, axis), axis.map(|c| -c));
        }
    }

    #[test]
    fn a_vector_without_length_has_no_rotation() {
        assert_eq!(between(AXES[0], [0.0; 3]), None);
        assert_eq!(Yaw::to_face_z(0.0, 0.0), None);
    }

    #[test]
    fn a_quarter_turn_about_the_vertical_takes_z_to_x() {
        let quarter = Yaw::from_half_angle(std::f64::consts::FRAC_PI_4);
        assert_close(rotate(quarter.quat(), [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0]);
        let [x, y, z] = quarter.rotate([0.0, 3.0, 2.0]).map(f64::from);
        assert_close([x, y, z], [2.0, 3.0, 0.0]);
    }

    #[test]
    fn bodies_facing_anywhere_are_turned_to_z() {
        for step in 0..16 {
            let angle = f64::from(step) * std::f64::consts::TAU / 16.0;
            let (x, z) = (3.0 * angle.sin(), 3.0 * angle.cos());
            let yaw = Yaw::to_face_z(x, z).expect("a direction");
            let (x, z) = yaw.rotate_xz(x, z);
            assert_close([x, 0.0, z], [0.0, 0.0, 3.0]);
            assert!(yaw.w >= 0.0 && (yaw.dot(yaw) - 1.0).abs() < 1e-12);
        }
    }

    proptest! {
        #[test]
        fn between_takes_the_axis_to_the_direction(axis in 0usize..4, to in direction()) {
            let q = between(AXES[axis], to).expect("a direction");
            assert_close(rotate(q, AXES[axis]), with_length(to, 1.0).unwrap());
        }

        #[test]
        fn a_product_applies_its_right_factor_first(a in direction(), b in direction(), v in direction()) {
            let (a, b) = (between(AXES[0], a).unwrap(), between(AXES[2], b).unwrap());
            assert_close(rotate(multiply(a, b), v), rotate(a, rotate(b, v)));
            assert_close(rotate(conjugate(a), rotate(a, v)), v);
        }

        #[test]
        fn six_numbers_hold_the_whole_rotation(to in direction(), scale in 0.5..2.0f32) {
            let q = between(AXES[3], to).expect("a direction");
            let columns = from_6d(to_6d(q).map(|c| c * scale));
            for i in 0..3 {
                let mut axis = [0.0; 3];
                axis[i] = 1.0;
                assert_close(columns[i], rotate(q, axis));
            }
        }
    }

    const X: Point = [1.0, 0.0, 0.0];

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
