//! Vectors of three numbers, as little as kinematics needs.

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
