//! Convolutions over frames: what their taps read is laid side by side, and multiplied once.

use burn::tensor::Tensor;
use burn::tensor::activation::relu;

use super::Product;
use crate::ops::{Convolution, Taps};

/// See [`Kernels::convolve`](crate::ops::Kernels::convolve).
pub fn convolve(
    x_nc: Tensor<2>,
    weight: Tensor<2>,
    bias_o: Tensor<1>,
    Convolution { n_clips, taps, rectify }: Convolution,
    product: Product,
) -> Tensor<2> {
    let [n, c] = x_nc.dims();
    let x_btc = if rectify { relu(x_nc) } else { x_nc }.reshape([n_clips, n / n_clips, c]);
    let read_btk = match taps {
        Taps::Point => x_btc,
        Taps::Neighbours(dilation) => neighbours(x_btc, dilation),
        Taps::Halving => fours(x_btc),
        Taps::Doubling => neighbours(upsample(x_btc), 1),
    };
    let [b, t, kc] = read_btk.dims();
    product.of(read_btk.reshape([b * t, kc]), weight) + bias_o.unsqueeze()
}

/// Each frame twice: nearest upsampling, `[b, t, c]` to `[b, 2t, c]`.
fn upsample(x_btc: Tensor<3>) -> Tensor<3> {
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
