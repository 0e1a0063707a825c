//! The same operations composed of burn's own: slower on the CPU, on every device, and the
//! reference that the kernels of [`own`](super::own) are held to.
//!
//! Shapes: n rows, d features, f hidden features, v vocabulary, b sequences, h heads, t positions
//! of the longest sequence, c features of a head.

use std::ops::Range;

use burn::tensor::activation::{log_softmax, silu, softmax};
use burn::tensor::{Bool, Device, FloatDType, Int, Tensor, TensorData};

use super::{
    Activation, AdamWStep, AttentionOptions, AttentionWeights, FeedForwardWeights, HeadWeights,
    Rope, SequenceLayout,
};

mod convolution;
mod cross;
mod nearest;

pub use convolution::convolve;
pub use cross::cross_attention;
pub use nearest::nearest;

/// Stands for minus infinity in masked scores: e to it is zero, and it is an ordinary number on
/// devices whose arithmetic has no infinities.
pub const MASKED: f32 = -1e30;

/// How matrices are multiplied.
#[derive(Clone, Copy)]
pub enum Product {
    Single,
    /// The operands are rounded to a smaller type, and the result is widened again.
    In(FloatDType),
}

impl Product {
    fn of<const D: usize>(self, left: Tensor<D>, right: Tensor<D>) -> Tensor<D> {
        match self {
            Product::Single => left.matmul(right),
            Product::In(dtype) => left.cast(dtype).matmul(right.cast(dtype)).cast(FloatDType::F32),
        }
    }
}

/// See [`Kernels::attention`](super::Kernels::attention).
pub fn attention_half(
    x_nd: Tensor<2>,
    weights: AttentionWeights,
    options: &AttentionOptions,
    product: Product,
) -> Tensor<2> {
    let normed_nd = rms_norm(x_nd.clone(), weights.gamma_d, options.epsilon);
    let qkv_n3d = product.of(normed_nd, weights.qkv_d3d);
    let mixed_nd = attention(qkv_n3d, options, product);
    x_nd + product.of(mixed_nd, weights.output_dd)
}

/// See [`Kernels::feed_forward`](super::Kernels::feed_forward).
pub fn feed_forward_half(
    x_nd: Tensor<2>,
    weights: FeedForwardWeights,
    activation: Activation,
    epsilon: f32,
    product: Product,
) -> Tensor<2> {
    let before_nu = product.of(rms_norm(x_nd.clone(), weights.gamma_d, epsilon), weights.up_du);
    let hidden_nf = match activation {
        Activation::SwiGlu => swiglu(before_nu),
        Activation::Gelu => gelu(before_nu),
    };
    x_nd + product.of(hidden_nf, weights.down_fd)
}

/// See [`Kernels::logits`](super::Kernels::logits).
pub fn logits(x_sd: Tensor<2>, weights: HeadWeights, epsilon: f32, product: Product) -> Tensor<2> {
    product.of(rms_norm(x_sd, weights.gamma_d, epsilon), weights.weight_dv)
}

/// See [`adamw`](super::adamw).
pub fn adamw(
    value: Tensor<1>,
    gradient: Tensor<1>,
    [first, second]: [Tensor<1>; 2],
    step: AdamWStep,
) -> (Tensor<1>, [Tensor<1>; 2]) {
    let gradient = gradient * step.clip;
    let first = first * step.beta_1 + gradient.clone() * (1.0 - step.beta_1);
    let second = second * step.beta_2 + gradient.clone() * gradient * (1.0 - step.beta_2);
    let move_by = first.clone() / (second.clone().sqrt() * step.scale + step.epsilon) * step.rate;
    (value * step.keep - move_by, [first, second])
}

/// y = x γ / √(mean(x²) + ε).
pub fn rms_norm(x_nd: Tensor<2>, gamma_d: Tensor<1>, epsilon: f32) -> Tensor<2> {
    let mean_square_n1 = x_nd.clone().powi_scalar(2).mean_dim(1);
    let rms_n1 = mean_square_n1.add_scalar(epsilon).sqrt();
    x_nd.div(rms_n1).mul(gamma_d.unsqueeze())
}

/// See [`Activation::SwiGlu`].
pub fn swiglu(gate_up_n2f: Tensor<2>) -> Tensor<2> {
    let [n, columns] = gate_up_n2f.dims();
    let gate_nf = gate_up_n2f.clone().slice([0..n, 0..columns / 2]);
    let up_nf = gate_up_n2f.slice([0..n, columns / 2..columns]);
    silu(gate_nf).mul(up_nf)
}

/// See [`Activation::Gelu`].
///
/// Composed, since the derivative of burn's own is that of the tanh approximation on every backend
/// but `flex`, 5e-4 off its value.
fn gelu(x_nf: Tensor<2>) -> Tensor<2> {
    let phi_nf = x_nf.clone().div_scalar(std::f64::consts::SQRT_2).erf().add_scalar(1.0) * 0.5;
    x_nf * phi_nf
}

/// See [`Kernels::select_rows`](super::Kernels::select_rows).
pub fn select_rows(x_md: Tensor<2>, rows: &[u32]) -> Tensor<2> {
    let device = x_md.device();
    x_md.select(0, integers(rows.iter().copied(), &device))
}

/// Mean cross-entropy of the rows' softmax, in nats.
pub fn cross_entropy(logits_nv: Tensor<2>, targets: &[u32]) -> Tensor<1> {
    log_likelihoods(logits_nv, targets).mean().neg()
}

/// Cross-entropy of each row, in nats.
pub fn nll(logits_nv: Tensor<2>, targets: &[u32]) -> Vec<f64> {
    let data = log_likelihoods(logits_nv.without_autodiff(), targets).into_data();
    data.iter::<f64>().map(|log_likelihood| -log_likelihood).collect()
}

/// ln p(target) of each row: `[n, 1]`.
fn log_likelihoods(logits_nv: Tensor<2>, targets: &[u32]) -> Tensor<2> {
    let targets_n = integers(targets.iter().copied(), &logits_nv.device());
    log_softmax(logits_nv, 1).gather(1, targets_n.unsqueeze_dim(1))
}

/// Attention of `[q | k | v]`, before the projection: pads the sequences to one length,
/// attends densely under a mask, and takes the padding out again.
pub fn attention(qkv_n3d: Tensor<2>, options: &AttentionOptions, product: Product) -> Tensor<2> {
    let AttentionOptions { n_head, layout, rope, .. } = options;
    let n_head = *n_head;
    let device = qkv_n3d.device();
    let (b, t, c) = (layout.n_sequences(), layout.max_len(), rope.head_dim());
    let d = n_head * c;
    let sequences: Vec<_> = (0..b).map(|i| layout.rows(i)).collect();
    let padded = qkv_n3d.select(0, integers(rows_of_padded(&sequences, t), &device));
    let part_bhtc = |part: usize| {
        let columns = padded.clone().slice([0..b * t, part * d..(part + 1) * d]);
        columns.reshape([b, t, n_head, c]).swap_dims(1, 2)
    };
    let turns = turns(rope, layout, &device);
    let queries_bhtc = turn(part_bhtc(0), &turns).div_scalar((c as f64).sqrt());
    let scores_bhtt = product.of(queries_bhtc, turn(part_bhtc(1), &turns).swap_dims(2, 3));
    let hidden_bhtt = hidden(layout, &device).expand([b, n_head, t, t]);
    let weights_bhtt = softmax(scores_bhtt.mask_fill(hidden_bhtt, MASKED), 3);
    let output = product.of(weights_bhtt, part_bhtc(2)).swap_dims(1, 2).reshape([b * t, d]);
    output.select(0, integers(padded_of_rows(&sequences, t), &device))
}

/// Cosines and sines of the angles of each position of the padded batch, `[b, 1, t, c / 2, 1]`, or of
/// the first t, `[1, 1, t, c / 2, 1]`, where sequences have no others.
fn turns(rope: &Rope, layout: &SequenceLayout, device: &Device) -> [Tensor<5>; 2] {
    let (b, t) = (layout.n_sequences(), layout.max_len());
    if layout.angles(0).is_none() {
        return rope.turns(1, &Vec::from_iter(0..t), device);
    }
    let place = |(i, q): (usize, usize)| {
        let angles = layout.angles(i).expect("all sequences have them, or none");
        angles.get(q).map_or(0, |&angle| angle as usize)
    };
    let places: Vec<usize> = (0..b).flat_map(|i| (0..t).map(move |q| (i, q))).map(place).collect();
    rope.turns(b, &places, device)
}

/// Turns the pairs of features of the first positions by their rows of `rope`, `[b, h, t, c]`.
pub fn rotate(x_bhtc: Tensor<4>, rope: &Rope) -> Tensor<4> {
    let (places, device) = (Vec::from_iter(0..x_bhtc.dims()[2]), x_bhtc.device());
    turn(x_bhtc, &rope.turns(1, &places, &device))
}

/// Turns the pairs of features by angles whose cosines and sines are `[b or 1, 1, t, c / 2, 1]`.
pub fn turn(x_bhtc: Tensor<4>, [cos, sin]: &[Tensor<5>; 2]) -> Tensor<4> {
    let [b, h, t, c] = x_bhtc.dims();
    let pairs = x_bhtc.reshape([b, h, t, c / 2, 2]);
    let even = pairs.clone().slice([0..b, 0..h, 0..t, 0..c / 2, 0..1]);
    let odd = pairs.slice([0..b, 0..h, 0..t, 0..c / 2, 1..2]);
    let turned_even = even.clone().mul(cos.clone()).sub(odd.clone().mul(sin.clone()));
    let turned_odd = even.mul(sin.clone()).add(odd.mul(cos.clone()));
    Tensor::cat(vec![turned_even, turned_odd], 4).reshape([b, h, t, c])
}

/// True where a position of the padded batch does not see another: `[b, 1, t, t]`.
fn hidden(layout: &SequenceLayout, device: &Device) -> Tensor<4, Bool> {
    let (b, t) = (layout.n_sequences(), layout.max_len());
    // A position of the padding, which nobody sees, sees the first: no row may be all hidden.
    let visible = |i: usize, q: usize| if q < layout.len(i) { layout.visible(i, q) } else { 1 };
    let visible = (0..b).flat_map(|i| (0..t).map(move |q| visible(i, q) as u32));
    let visible_b1t1 = integers(visible, device).reshape([b, 1, t, 1]);
    let keys_111t = integers(0..t as u32, device).reshape([1, 1, 1, t]);
    keys_111t.expand([b, 1, t, t]).greater_equal(visible_b1t1.expand([b, 1, t, t]))
}

/// The row of each position of sequences that are padded to `t` rows; a sequence's first for padding.
fn rows_of_padded(sequences: &[Range<usize>], t: usize) -> impl Iterator<Item = u32> {
    let row =
        move |rows: &Range<usize>, q| if q < rows.len() { rows.start + q } else { rows.start };
    sequences.iter().flat_map(move |rows| (0..t).map(move |q| row(rows, q) as u32))
}

/// The position in the padded batch of each row.
fn padded_of_rows(sequences: &[Range<usize>], t: usize) -> impl Iterator<Item = u32> {
    let own = move |(i, rows): (usize, &Range<usize>)| {
        (i * t..i * t + rows.len()).map(|position| position as u32)
    };
    sequences.iter().enumerate().flat_map(own)
}

fn integers(values: impl Iterator<Item = u32>, device: &Device) -> Tensor<1, Int> {
    let values: Vec<i64> = values.map(i64::from).collect();
    let n = values.len();
    Tensor::from_data(TensorData::new(values, [n]), device)
}
