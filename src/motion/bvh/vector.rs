//! Vectors in double precision, as little as kinematics needs.

pub fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scale(a: [f64; 3], k: f64) -> [f64; 3] {
    a.map(|c| c * k)
}

pub fn norm(a: [f64; 3]) -> f64 {
    a.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// `a` with the given length; `None` where it has no direction.
pub fn with_length(a: [f64; 3], length: f64) -> Option<[f64; 3]> {
    let own = norm(a);
    (own > 1e-9).then(|| scale(a, length / own))
}
