//! Vectors and rotation matrices, as little as the body needs.

/// A vector or a point.
pub type V3 = [f32; 3];

/// `a + b`.
pub fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a - b`.
pub fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `k a`.
pub fn scale(a: V3, k: f32) -> V3 {
    [a[0] * k, a[1] * k, a[2] * k]
}

/// `a × b`.
pub fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Euclidean length.
pub fn norm(a: V3) -> f32 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
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
        self.0.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
    }
}
