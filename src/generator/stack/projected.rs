//! [`projected`]: vectors from outside of a model, as wide as its rows.

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};

/// x W + b of row-major vectors, each as long as the weight has rows, `[n, d]`.
pub fn projected(
    values: Vec<f32>,
    weight: &Param<Tensor<2>>,
    bias: &Param<Tensor<1>>,
    device: &Device,
) -> Tensor<2> {
    let [channels, _] = weight.dims();
    let rows = values.len() / channels;
    let x = Tensor::<2>::from_data(TensorData::new(values, [rows, channels]), device);
    x.matmul(weight.val()) + bias.val().unsqueeze::<2>()
}
