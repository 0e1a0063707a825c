//! Vectors and rotation matrices, as little as the body needs.

use crate::motion::vector::{dot, scale};

/// A vector or a point.
pub type V3 = [f32; 3];

/// Euclidean length.
pub fn norm(a: V3) -> f32 {
    dot(a, a).sqrt()
}

/// `a` with length 1.
pub fn unit(a: V3) -> V3 {
    scale(a, 1.0 / norm(a))
}

/// A rotation, by rows.
#[derive(Clone, Copy, Debug)]
pub struct Rotation([V3; 3]);

impl Rotation {
    /// About x; positive tips up towards +z, a bend forward.
    pub fn x(angle: f32) -> Self {
        let (s, c) = angle.sin_cos();
        Self([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    }

    /// About y; positive turns +z towards +x, a turn to the left.
    pub fn y(angle: f32) -> Self {
        let (s, c) = angle.sin_cos();
        Self([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    }

    /// About z; positive tips up towards -x, a lean to the right.
    pub fn z(angle: f32) -> Self {
        let (s, c) = angle.sin_cos();
        Self([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    }

    /// About z, then about x, then about y.
    pub fn yxz(y: f32, x: f32, z: f32) -> Self {
        Self::y(y).after(Self::x(x)).after(Self::z(z))
    }

    /// First `other`, then `self`.
    pub fn after(self, other: Self) -> Self {
        let (a, b) = (self.0, other.0);
        Self(a.map(|row| {
            let column = |j: usize| row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j];
            [column(0), column(1), column(2)]
        }))
    }

    /// The rotated vector.
    pub fn of(self, v: V3) -> V3 {
        self.0.map(|row| dot(row, v))
    }
}
