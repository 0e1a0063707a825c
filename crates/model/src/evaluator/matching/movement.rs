//! [`Movement`]: frames into rows, one of four frames.
//!
//! Shapes: n motions of r rows at most, f features, c channels.

use burn::module::Module;
use burn::tensor::activation::leaky_relu;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use super::reader::SLOPE;
use crate::evaluator::rows::Rows;
use crate::learn::layers::{Affine, Conv1d};
use crate::learn::params::unit;

/// Frames of a row.
const FRAMES: usize = 4;

/// Two convolutions, each of which halves the rate, and a layer.
#[derive(Module, Debug)]
pub struct Movement {
    first: Conv1d,
    second: Conv1d,
    output: Affine,
    #[module(skip)]
    dropout: f64,
}

impl Movement {
    /// From frames of `n_features` to rows of `width`.
    pub fn init(
        n_features: usize,
        width: usize,
        dropout: f64,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        Self {
            first: Conv1d::halving([n_features, width], rng, device),
            second: Conv1d::halving([width, width], rng, device),
            output: Affine::new(width, width, rng, device),
            dropout,
        }
    }

    /// Rows of four frames each, `[n r, c]`; motions that have fewer rows than the longest are filled up.
    pub fn rows(&self, rows: &Rows, mut rng: Option<&mut ChaCha8Rng>) -> Tensor<2> {
        let device = self.output.device();
        let x_ntf = frames(rows, &device);
        let first = rectified(self.first.forward(x_ntf), self.dropout, rng.as_deref_mut());
        // Beyond the end of a motion there is nothing, as beyond that of the longest.
        let first = first * there(rows, &device);
        let second = rectified(self.second.forward(first), self.dropout, rng);
        let [n, r, c] = second.dims();
        self.output.forward(second.reshape([n * r, c]))
    }
}

/// Motions side by side, `[n, 4 r, f]`, filled up with zeros.
fn frames(rows: &Rows, device: &Device) -> Tensor<3> {
    let (n, longest) = (rows.lengths.len(), longest(rows));
    let channels = rows.values.len() / rows.lengths.iter().sum::<usize>();
    let mut values = Vec::with_capacity(n * longest * channels);
    let mut start = 0;
    for (i, length) in rows.lengths.iter().enumerate() {
        values.extend_from_slice(&rows.values[start..start + length * channels]);
        values.resize((i + 1) * longest * channels, 0.0);
        start += length * channels;
    }
    let shape = [n, FRAMES * longest, channels / FRAMES];
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// 1 where a motion has a frame at half the rate, else 0, `[n, 2 r, 1]`.
fn there(rows: &Rows, device: &Device) -> Tensor<3> {
    let halves = 2 * longest(rows);
    let of = |length: &usize| {
        let own = 2 * length;
        (0..halves).map(move |half| f32::from(u8::from(half < own)))
    };
    let values: Vec<f32> = rows.lengths.iter().flat_map(of).collect();
    Tensor::from_data(TensorData::new(values, [rows.lengths.len(), halves, 1]), device)
}

fn longest(rows: &Rows) -> usize {
    rows.lengths.iter().copied().max().unwrap_or(0)
}

/// The rectifier, after some channels are left out in training.
fn rectified(x: Tensor<3>, dropout: f64, rng: Option<&mut ChaCha8Rng>) -> Tensor<3> {
    let x = match rng {
        Some(rng) if dropout > 0.0 => {
            let (shape, device) = (x.dims(), x.device());
            let kept = (1.0 / (1.0 - dropout)) as f32;
            let values = (0..shape.iter().product())
                .map(|_| if unit(rng) < dropout { 0.0 } else { kept })
                .collect::<Vec<f32>>();
            x * Tensor::from_data(TensorData::new(values, shape), &device)
        }
        _ => x,
    };
    leaky_relu(x, SLOPE)
}
