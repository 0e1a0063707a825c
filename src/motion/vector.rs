//! Vectors in double precision, as little as kinematics needs.

/// A place or a direction.
pub type Point = [f64; 3];

pub fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scale(a: Point, k: f64) -> Point {
    a.map(|c| c * k)
}

#[inline]
pub fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn norm(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// `a` with the given length; `None` where it has no direction.
pub fn with_length(a: Point, length: f64) -> Option<Point> {
    let own = norm(a);
    (own > 1e-9).then(|| scale(a, length / own))
}
