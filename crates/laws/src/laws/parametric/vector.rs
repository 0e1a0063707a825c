//! Vectors and matrices of a handful of parameters, on the stack.

/// Most parameters of a form: three terms of two each, and the constant.
pub(super) const MAX_PARAMS: usize = 7;

pub(super) type Vector = [f64; MAX_PARAMS];
pub(super) type Matrix = [[f64; MAX_PARAMS]; MAX_PARAMS];

/// The scalar product of the first `n` entries.
pub(super) fn dot(a: &Vector, b: &Vector, n: usize) -> f64 {
    (0..n).map(|i| a[i] * b[i]).sum()
}

/// The first `n` entries of M v.
pub(super) fn times(m: &Matrix, v: &Vector, n: usize) -> Vector {
    std::array::from_fn(|i| if i < n { dot(&m[i], v, n) } else { 0.0 })
}
