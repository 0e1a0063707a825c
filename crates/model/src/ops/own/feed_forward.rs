//! The feed-forward half of a block, a few rows at a time: x + activation(RMSNorm(x) W_up) W_down.
//!
//! Rows are independent here, so a chunk of them goes through the whole half while its intermediate results are in the
//! cache, and only the products by W_up are kept for the backward pass.

use burn_flex::FlexTensor;

use super::buffers::{
    AHEAD, Buffer, chunks, dims, elements, elements_mut, part, part_mut, prefetch,
};
use super::lanes::{LANES, Lanes};
use super::matmul::{Start, Target, multiply, multiply_transposed};
use super::panels::{Panels, View, transposed};
use super::rows::{exp_below_88, rms_norm, rms_norm_again, rms_norm_back, sigmoid};
use super::vectors::vectorised;
use super::{Above, Gradients, Operation};
use crate::ops::Activation;

/// Rows of a chunk: whole tiles of any kind.
const CHUNK: usize = 132;

/// The feed-forward half of a block, of x `[n, d]`, γ, W_up `[d, u]` and W_down `[f, d]`, where u is 2 f
/// or f, as the activation wants; see [`Kernels::feed_forward`](crate::ops::Kernels::feed_forward).
#[derive(Clone, Copy, Debug)]
pub struct FeedForward {
    pub activation: Activation,
    pub epsilon: f32,
}

/// The data of the backward pass, besides the input.
#[derive(Clone, Debug)]
pub struct Intermediates {
    /// 1 / rms of each row.
    inverses: Buffer,
    /// RMSNorm(x) W_up, `[n, u]`.
    before: Buffer,
}

impl Operation<4> for FeedForward {
    type Kept = ([FlexTensor; 4], Intermediates);

    fn forward(&self, inputs: &[FlexTensor; 4], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let [x, gamma, w_up, w_down] = inputs.each_ref().map(elements);
        let ([n, d], u, f) = (dims(&inputs[0]), dims(&inputs[2])[1], dims(&inputs[3])[0]);
        let up = Panels::of(View::new(w_up, u), d, u);
        let down = Panels::of(View::new(w_down, d), f, d);
        let mut output = Buffer::new(n * d);
        let (mut normed, mut hidden) = (Buffer::new(CHUNK * d), Buffer::new(CHUNK * f));
        let mut inverses = Buffer::new(n);
        let mut before = Buffer::new(if keep { n } else { CHUNK } * u);
        for rows in chunks(n, CHUNK) {
            let count = rows.len();
            let inverses = &mut inverses[rows.clone()];
            rms_norm(part(x, &rows, d), gamma, self.epsilon, &mut normed, inverses);
            let kept = if keep { rows.clone() } else { 0..count };
            let before = part_mut(&mut before, &kept, u);
            multiply(Target::new(before, u), count, View::new(&normed, d), &up, Start::Zero);
            match self.activation {
                Activation::SwiGlu => swiglu(before, f, &mut hidden),
                Activation::Gelu => gelu(before, &mut hidden),
            }
            let output = part_mut(&mut output, &rows, d);
            let (target, from) =
                (Target::new(output, d), Start::Rows(View::new(part(x, &rows, d), d)));
            multiply(target, count, View::new(&hidden, f), &down, from);
        }
        let kept = || (inputs.clone(), Intermediates { inverses, before });
        (output.into_tensor([n, d]), keep.then(kept))
    }

    fn backward(&self, (inputs, kept): Self::Kept, (mut gradient, _): Above<4>) -> Gradients<4> {
        let [x, gamma, w_up, w_down] = inputs.each_ref().map(elements);
        let ([n, d], u, f) = (dims(&inputs[0]), dims(&inputs[2])[1], dims(&inputs[3])[0]);
        let by_x = elements_mut(&mut gradient);
        let up = Panels::of(View::new(w_up, u).transposed(), u, d);
        let down = Panels::of(View::new(w_down, d).transposed(), d, f);
        let mut by_gamma = Buffer::zeros(d);
        let [mut by_up, mut by_down] = [d * u, f * d].map(Buffer::new);
        let (mut normed, mut hidden) = (Buffer::new(CHUNK * d), Buffer::new(CHUNK * f));
        let (mut by_before, mut panels) = (Buffer::new(CHUNK * u), Panels::default());
        for rows in chunks(n, CHUNK) {
            let (count, inverses) = (rows.len(), &kept.inverses[rows.clone()]);
            let (x, by_x) = (part(x, &rows, d), part_mut(by_x, &rows, d));
            let before = part(&kept.before, &rows, u);
            multiply(Target::new(&mut hidden, f), count, View::new(by_x, d), &down, Start::Zero);
            match self.activation {
                Activation::SwiGlu => swiglu_back(before, f, &mut by_before, &mut hidden),
                Activation::Gelu => gelu_back(before, &mut by_before, &mut hidden),
            }
            let (hidden, change) = (View::new(&hidden, f), View::new(by_x, d));
            let target = Target::new(&mut by_down, d);
            multiply_transposed(target, (f, d), hidden, change, &rows, &mut panels);
            rms_norm_again(x, gamma, inverses, &mut normed);
            let (input, change) = (View::new(&normed, d), View::new(&by_before, u));
            let target = Target::new(&mut by_up, d);
            multiply_transposed(target, (u, d), change, input, &rows, &mut panels);
            multiply(Target::new(&mut normed, d), count, change, &up, Start::Zero);
            rms_norm_back(&mut normed, x, gamma, inverses, &mut by_gamma, by_x);
        }
        drop(inputs);
        let (by_gamma, by_up) = (by_gamma.into_tensor([d]), transposed(&by_up, d));
        [gradient, by_gamma, by_up.into_tensor([d, u]), by_down.into_tensor([f, d])].map(Some)
    }
}

// SwiGLU, over rows of `[gate | up]`.

vectorised! {
    /// silu(gate) up for rows `[gate | up]` of `2 f` columns, into `output` `[n, f]`.
    fn swiglu(gate_up: &[f32], f: usize, output: &mut [f32]) {
        for (row, output) in gate_up.chunks_exact(2 * f).zip(output.chunks_exact_mut(f)) {
            let (gate, up) = row.split_at(f);
            let operands = gate.chunks(LANES).zip(up.chunks(LANES));
            for (output, (gate, up)) in output.chunks_mut(LANES).zip(operands) {
                let gate = L::read(gate);
                gate.mul(sigmoid(gate)).mul(L::read(up)).write(output);
            }
        }
    }
}

vectorised! {
    /// The gradient by `[gate | up]`, into `change`; turns that by the output into the output.
    fn swiglu_back(gate_up: &[f32], f: usize, change: &mut [f32], output: &mut [f32]) {
        let rows = gate_up.chunks_exact(2 * f).zip(change.chunks_exact_mut(2 * f));
        let ahead = AHEAD.next_multiple_of(2 * f);
        for ((row, change), output) in rows.zip(output.chunks_exact_mut(f)) {
            let ((gate, up), (by_gate, by_up)) = (row.split_at(f), change.split_at_mut(f));
            let from = gate.chunks(LANES).zip(up.chunks(LANES));
            let to = by_gate.chunks_mut(LANES).zip(by_up.chunks_mut(LANES));
            for (((gate, up), (by_gate, by_up)), output) in
                from.zip(to).zip(output.chunks_mut(LANES))
            {
                prefetch(gate.as_ptr().wrapping_add(ahead));
                prefetch(up.as_ptr().wrapping_add(ahead));
                let operands = [L::read(gate), L::read(up), L::read(output)];
                let by = swiglu_gradients(operands);
                by[0].write(by_gate);
                by[1].write(by_up);
                by[2].write(output);
            }
        }
    }
}

/// Gradients by gate and up, g up σ (1 + gate (1 − σ)) and g gate σ, and the output.
#[inline(always)]
fn swiglu_gradients<L: Lanes>([gate, up, gradient]: [L; 3]) -> [L; 3] {
    let sigmoid = sigmoid(gate);
    let silu = gate.mul(sigmoid);
    let slope = sigmoid.mul(L::splat(1.0).add(gate).sub(silu));
    [gradient.mul(up).mul(slope), gradient.mul(silu), silu.mul(up)]
}

/// SwiGLU alone, of `[gate | up]`, which it keeps. See
/// [`Kernels::swi_glu`](crate::ops::Kernels::swi_glu).
#[derive(Clone, Copy, Debug)]
pub struct SwiGlu;

impl Operation<1> for SwiGlu {
    type Kept = FlexTensor;

    fn forward(&self, [gate_up]: &[FlexTensor; 1], keep: bool) -> (FlexTensor, Option<FlexTensor>) {
        let [n, columns] = dims(gate_up);
        let mut output = Buffer::new(n * columns / 2);
        swiglu(elements(gate_up), columns / 2, &mut output);
        (output.into_tensor([n, columns / 2]), keep.then(|| gate_up.clone()))
    }

    fn backward(&self, gate_up: FlexTensor, (mut gradient, _): Above<1>) -> Gradients<1> {
        let [n, columns] = dims(&gate_up);
        let mut by = Buffer::new(n * columns);
        let change = elements_mut(&mut gradient);
        swiglu_back(elements(&gate_up), columns / 2, &mut by, change);
        [Some(by.into_tensor([n, columns]))]
    }
}

// GELU, x Φ(x), from Φ of the negative magnitude.

vectorised! {
    /// x Φ(x) of each element, into `output`.
    fn gelu(x: &[f32], output: &mut [f32]) {
        for (output, x) in output.chunks_mut(LANES).zip(x.chunks(LANES)) {
            let x = L::read(x);
            let [tail, _] = tail_and_density(x);
            gelu_of(x, tail).write(output);
        }
    }
}

vectorised! {
    /// The gradient by `x`, into `change`; turns that by the output into the output.
    fn gelu_back(x: &[f32], change: &mut [f32], output: &mut [f32]) {
        let to = change.chunks_mut(LANES).zip(output.chunks_mut(LANES));
        for (x, (change, output)) in x.chunks(LANES).zip(to) {
            let (value, gradient) = (L::read(x), L::read(output));
            let [tail, density] = tail_and_density(value);
            let (zero, one) = (L::splat(0.0), L::splat(1.0));
            let positive = one.min(zero.max(value.mul(L::splat(1e38))));
            let phi = positive.mul_add(one.sub(tail).sub(tail), tail);
            gradient.mul(value.mul_add(density, phi)).write(change);
            gelu_of(value, tail).write(output);
        }
    }
}

/// max(x, 0) − |x| Φ(−|x|).
#[inline(always)]
fn gelu_of<L: Lanes>(x: L, tail: L) -> L {
    let zero = L::splat(0.0);
    zero.max(x).sub(magnitude(x).mul(tail))
}

#[inline(always)]
fn magnitude<L: Lanes>(x: L) -> L {
    L::splat(0.0).sub(x).max(x)
}

/// Φ(−|x|) within 1e-7 (Abramowitz and Stegun 1964, 7.1.26), and the normal density at x.
#[inline(always)]
fn tail_and_density<L: Lanes>(x: L) -> [L; 2] {
    let one = L::splat(1.0);
    let z = magnitude(x).mul(L::splat(std::f32::consts::FRAC_1_SQRT_2));
    let t = one.div(z.mul_add(L::splat(0.327_591_1), one));
    let mut series = L::splat(1.061_405_4);
    for coefficient in [-1.453_152, 1.421_413_7, -0.284_496_74, 0.254_829_6] {
        series = series.mul_add(t, L::splat(coefficient));
    }
    let power = exp_below_88(L::splat(0.0).sub(z.mul(z)));
    let tail = series.mul(t).mul(power).mul(L::splat(0.5));
    [tail, power.mul(L::splat(0.398_942_3))]
}
