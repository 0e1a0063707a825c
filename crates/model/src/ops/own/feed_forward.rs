//! The feed-forward half of a block, a few rows at a time: x + activation(RMSNorm(x) W_up) W_down.
//!
//! Rows do not see each other here, so a chunk of them goes through the whole half while what it
//! makes is still in the cache, and only the products by W_up are kept for the way back.

use std::ops::Range;

use super::buffers::Buffer;
use super::matmul::{Panels, Target, View, add_transposed, multiply, transposed};
use super::{gelu, rms_norm, swiglu};
use crate::ops::Activation;

/// Rows of a chunk.
const CHUNK: usize = 128;

/// The parameters, row-major.
#[derive(Clone, Copy)]
pub struct Weights<'a> {
    /// `[d]`.
    pub gamma: &'a [f32],
    /// `[d, u]`, where u is 2 f or f, as the activation wants.
    pub up: &'a [f32],
    /// `[f, d]`.
    pub down: &'a [f32],
    pub activation: Activation,
    pub epsilon: f32,
}

/// What the way back needs beside the input.
#[derive(Clone, Debug)]
pub struct Intermediates {
    /// 1 / rms of each row.
    inverses: Buffer,
    /// RMSNorm(x) W_up, `[n, u]`.
    before: Buffer,
}

impl Weights<'_> {
    fn d(&self) -> usize {
        self.gamma.len()
    }

    fn f(&self) -> usize {
        self.down.len() / self.d()
    }

    /// Columns of W_up.
    fn u(&self) -> usize {
        self.up.len() / self.d()
    }
}

/// The output `[n, d]` for `x` `[n, d]`, and what to keep if `keep` asks for it.
pub fn forward(x: &[f32], weights: Weights<'_>, keep: bool) -> (Buffer, Option<Intermediates>) {
    let (d, f, u) = (weights.d(), weights.f(), weights.u());
    let n = x.len() / d;
    let up = Panels::of(View::new(weights.up, u), d, u);
    let down = Panels::of(View::new(weights.down, d), f, d);
    let mut output = Buffer::new(n * d);
    let (mut normed, mut hidden) = (Buffer::new(CHUNK * d), Buffer::new(CHUNK * f));
    let mut inverses = Buffer::new(n);
    let mut before = Buffer::new(if keep { n } else { CHUNK } * u);
    for rows in chunks(n, CHUNK) {
        let count = rows.len();
        let inverses = &mut inverses[rows.clone()];
        rms_norm::forward(part(x, &rows, d), weights.gamma, weights.epsilon, &mut normed, inverses);
        let kept = if keep { rows.clone() } else { 0..count };
        let before = part_mut(&mut before, &kept, u);
        multiply(Target::new(before, u), count, View::new(&normed, d), &up, false);
        match weights.activation {
            Activation::SwiGlu => swiglu::forward(before, f, &mut hidden),
            Activation::Gelu => gelu::forward(before, &mut hidden),
        }
        let output = part_mut(&mut output, &rows, d);
        output.copy_from_slice(part(x, &rows, d));
        multiply(Target::new(output, d), count, View::new(&hidden, f), &down, true);
    }
    (output, keep.then_some(Intermediates { inverses, before }))
}

/// Turns the gradient by the output into that by `x`; gives those by γ, W_up and W_down.
pub fn backward(
    gradient: &mut [f32],
    x: &[f32],
    weights: Weights<'_>,
    kept: Intermediates,
) -> [Buffer; 3] {
    let (d, f, u) = (weights.d(), weights.f(), weights.u());
    let up = Panels::of(View::new(weights.up, u).transposed(), u, d);
    let down = Panels::of(View::new(weights.down, d).transposed(), d, f);
    let [mut by_gamma, mut by_up, mut by_down] = [d, d * u, f * d].map(Buffer::zeros);
    let (mut normed, mut hidden) = (Buffer::new(CHUNK * d), Buffer::new(CHUNK * f));
    let (mut by_before, mut panels) = (Buffer::new(CHUNK * u), Panels::default());
    for rows in chunks(x.len() / d, CHUNK) {
        let (count, inverses) = (rows.len(), &kept.inverses[rows.clone()]);
        let (x, gradient) = (part(x, &rows, d), part_mut(gradient, &rows, d));
        let before = part(&kept.before, &rows, u);
        multiply(Target::new(&mut hidden, f), count, View::new(gradient, d), &down, false);
        match weights.activation {
            Activation::SwiGlu => swiglu::backward(before, f, &mut by_before, &mut hidden),
            Activation::Gelu => gelu::backward(before, &mut by_before, &mut hidden),
        }
        let (hidden, change) = (View::new(&hidden, f), View::new(gradient, d));
        add_transposed(Target::new(&mut by_down, d), (f, d), hidden, change, count, &mut panels);
        rms_norm::again(x, weights.gamma, inverses, &mut normed);
        let (input, change) = (View::new(&normed, d), View::new(&by_before, u));
        add_transposed(Target::new(&mut by_up, d), (u, d), change, input, count, &mut panels);
        multiply(Target::new(&mut normed, d), count, change, &up, false);
        rms_norm::backward(&mut normed, x, weights.gamma, inverses, &mut by_gamma, gradient);
    }
    [by_gamma, transposed(&by_up, d), by_down]
}

/// `0..n` in pieces of `size`.
pub fn chunks(n: usize, size: usize) -> impl Iterator<Item = Range<usize>> {
    (0..n).step_by(size).map(move |first| first..n.min(first + size))
}

/// Rows of a matrix of `columns` columns.
pub fn part<'a>(matrix: &'a [f32], rows: &Range<usize>, columns: usize) -> &'a [f32] {
    &matrix[rows.start * columns..rows.end * columns]
}

/// Rows of a matrix of `columns` columns, for writing.
pub fn part_mut<'a>(matrix: &'a mut [f32], rows: &Range<usize>, columns: usize) -> &'a mut [f32] {
    &mut matrix[rows.start * columns..rows.end * columns]
}
