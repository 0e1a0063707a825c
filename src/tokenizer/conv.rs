//! One-dimensional convolutions on channels-last activations, each as one matrix product.
//!
//! The taps of a convolution are laid side by side, `[b, t, k·c]`, and multiplied by one weight,
//! which is faster on the CPU than burn's `conv1d` and gives each output the same bits whatever
//! the batch around it.
//!
//! Shapes: b clips, t frames, c channels, k taps, n = b·t rows.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::train::params;

/// A linear layer with bias, x W + b, drawn as PyTorch draws its own: uniform in ±1/√fan_in.
#[derive(Module, Debug)]
pub struct Affine {
    /// `[c_in, c_out]`.
    weight: Param<Tensor<2>>,
    /// `[c_out]`.
    bias: Param<Tensor<1>>,
}

impl Affine {
    /// A layer from `c_in` to `c_out` channels.
    pub fn new(c_in: usize, c_out: usize, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let bound = (c_in as f64).sqrt().recip();
        Self {
            weight: params::uniform([c_in, c_out], bound, rng, device),
            bias: params::uniform([c_out], bound, rng, device),
        }
    }

    /// Where the weights are.
    pub fn device(&self) -> Device {
        self.weight.device()
    }

    /// `[n, c_in]` to `[n, c_out]`.
    pub fn forward(&self, x_nc: Tensor<2>) -> Tensor<2> {
        x_nc.matmul(self.weight.val()) + self.bias.val().unsqueeze()
    }

    /// `[b, t, c_in]` to `[b, t, c_out]`, frame by frame.
    pub fn forward_frames(&self, x_btc: Tensor<3>) -> Tensor<3> {
        let [b, t, c] = x_btc.dims();
        let y_nc = self.forward(x_btc.reshape([b * t, c]));
        let c_out = y_nc.dims()[1];
        y_nc.reshape([b, t, c_out])
    }
}

/// Which frames an output frame is made from.
#[derive(Clone, Copy, Debug)]
enum Taps {
    /// The frame itself (kernel 1).
    Point,
    /// The frame and its neighbours at this distance (kernel 3, padding = dilation).
    Neighbours(usize),
    /// Four frames for every second one (kernel 4, stride 2, padding 1).
    Halving,
}

impl Taps {
    fn count(self) -> usize {
        match self {
            Taps::Point => 1,
            Taps::Neighbours(_) => 3,
            Taps::Halving => 4,
        }
    }
}

/// A convolution over frames with bias and zero padding.
#[derive(Module, Debug)]
pub struct Conv1d {
    /// Weight `[k·c_in, c_out]`, the earliest tap first.
    affine: Affine,
    #[module(skip)]
    taps: Taps,
}

impl Conv1d {
    /// Kernel 1.
    pub fn point(channels: [usize; 2], rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self::new(Taps::Point, channels, rng, device)
    }

    /// Kernel 3 with this dilation; as many frames out as in.
    pub fn same(
        channels: [usize; 2],
        dilation: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        Self::new(Taps::Neighbours(dilation), channels, rng, device)
    }

    /// Kernel 4, stride 2, padding 1; half as many frames out as in, which must be even.
    pub fn halving(channels: [usize; 2], rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self::new(Taps::Halving, channels, rng, device)
    }

    fn new(taps: Taps, [c_in, c_out]: [usize; 2], rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self { affine: Affine::new(taps.count() * c_in, c_out, rng, device), taps }
    }

    /// `[b, t, c_in]` to `[b, t, c_out]`, or `[b, t/2, c_out]` where the convolution halves.
    pub fn forward(&self, x_btc: Tensor<3>) -> Tensor<3> {
        let taps = match self.taps {
            Taps::Point => x_btc,
            Taps::Neighbours(dilation) => neighbours(x_btc, dilation),
            Taps::Halving => fours(x_btc),
        };
        self.affine.forward_frames(taps)
    }
}

/// Each frame twice: nearest upsampling, `[b, t, c]` to `[b, 2t, c]`.
pub fn upsample(x_btc: Tensor<3>) -> Tensor<3> {
    let [b, t, c] = x_btc.dims();
    Tensor::cat(vec![x_btc.clone(), x_btc], 2).reshape([b, 2 * t, c])
}

/// `[b, t, 3c]`: the frames at −dilation, 0 and +dilation.
fn neighbours(x_btc: Tensor<3>, dilation: usize) -> Tensor<3> {
    let t = x_btc.dims()[1];
    let padded = pad_frames(x_btc, dilation);
    let taps = (0..3).map(|tap| padded.clone().narrow(1, tap * dilation, t)).collect();
    Tensor::cat(taps, 2)
}

/// `[b, t/2, 4c]`: the frames 2i − 1 to 2i + 2, as two neighbouring pairs of frames.
fn fours(x_btc: Tensor<3>) -> Tensor<3> {
    let [b, t, c] = x_btc.dims();
    assert!(t.is_multiple_of(2), "clips are cropped to whole tokens before they are encoded");
    let pairs = pad_frames(x_btc, 1).reshape([b, t / 2 + 1, 2 * c]);
    let second = pairs.clone().narrow(1, 1, t / 2);
    Tensor::cat(vec![pairs.narrow(1, 0, t / 2), second], 2)
}

/// `n` frames of zeros at either end.
fn pad_frames(x_btc: Tensor<3>, n: usize) -> Tensor<3> {
    let [b, _, c] = x_btc.dims();
    let zeros = Tensor::zeros([b, n, c], &x_btc.device());
    Tensor::cat(vec![zeros.clone(), x_btc, zeros], 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::module::conv1d;
    use burn::tensor::ops::ConvOptions;
    use burn::tensor::{TensorData, Tolerance};
    use rand_chacha::rand_core::SeedableRng;

    fn frames(shape: [usize; 3]) -> Tensor<3> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        params::normal(shape, 1.0, &mut rng, &Device::flex().autodiff()).val().inner()
    }

    /// burn's own convolution with the weights of `conv`.
    fn reference(conv: &Conv1d, x_btc: Tensor<3>, options: ConvOptions<1>) -> TensorData {
        let k = conv.taps.count();
        let [rows, c_out] = conv.affine.weight.dims();
        let weight = conv.affine.weight.val().reshape([k, rows / k, c_out]).permute([2, 1, 0]);
        let y = conv1d(x_btc.swap_dims(1, 2), weight, Some(conv.affine.bias.val()), options);
        y.swap_dims(1, 2).into_data()
    }

    #[test]
    fn products_agree_with_the_convolutions_of_burn() {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(1));
        let x_btc = frames([3, 12, 5]);
        let same = |dilation| ConvOptions::new([1], [dilation], [dilation], 1);
        let cases = [
            (Conv1d::point([5, 7], &mut rng, &device), ConvOptions::new([1], [0], [1], 1)),
            (Conv1d::same([5, 7], 1, &mut rng, &device), same(1)),
            (Conv1d::same([5, 7], 9, &mut rng, &device), same(9)),
            (Conv1d::halving([5, 7], &mut rng, &device), ConvOptions::new([2], [1], [1], 1)),
        ];
        for (conv, options) in cases {
            let expected = reference(&conv.valid(), x_btc.clone(), options);
            let actual = conv.valid().forward(x_btc.clone()).into_data();
            actual.assert_approx_eq::<f32>(&expected, Tolerance::absolute(1e-5));
        }
    }

    #[test]
    fn upsampling_repeats_each_frame() {
        let x_btc = Tensor::<3>::from_data([[[1.0, 2.0], [3.0, 4.0]]], &Device::flex());
        let expected = TensorData::from([[[1.0f32, 2.0], [1.0, 2.0], [3.0, 4.0], [3.0, 4.0]]]);
        assert_eq!(upsample(x_btc).into_data(), expected);
    }
}
