//! Numbers of double precision in tensors of single precision.

use burn::tensor::Tensor;

/// Numbers that come as a large and a small part each.
pub(super) fn sums_of_parts<const D: usize>(parts: Tensor<D>) -> Vec<f64> {
    let data = parts.into_data();
    let parts = data.as_slice::<f32>().expect("the own operations compute in f32");
    parts.as_chunks().0.iter().map(|&[large, small]| f64::from(large) + f64::from(small)).collect()
}
