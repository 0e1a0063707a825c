//! The attention half of a block, a few sequences at a time:
//! x + Attention(RMSNorm(x) W_qkv) W_output.
//!
//! Sequences do not see each other, so a chunk of them goes through the whole half while what it
//! makes is still in the cache.

use std::ops::Range;

use super::{Heads, Workspace, backward as attend_back, forward as attend};
use crate::ops::SequenceLayout;
use crate::ops::own::buffers::Buffer;
use crate::ops::own::feed_forward::{part, part_mut};
use crate::ops::own::matmul::{Panels, Target, View, add_transposed, multiply, transposed};
use crate::ops::own::rms_norm;

/// Rows of a chunk, but for a longer sequence.
const CHUNK: usize = 128;

/// The parameters, row-major.
#[derive(Clone, Copy)]
pub struct Weights<'a> {
    /// `[d]`.
    pub gamma: &'a [f32],
    /// `[d, 3 d]`.
    pub qkv: &'a [f32],
    /// `[d, d]`.
    pub output: &'a [f32],
    pub epsilon: f32,
}

/// What the way back needs beside the input.
#[derive(Clone, Debug)]
pub struct Intermediates {
    /// 1 / rms of each row.
    inverses: Buffer,
    /// Queries, keys and values before they are turned, `[n, 3 d]`.
    qkv: Buffer,
    /// What makes attention's weights from its scores.
    statistics: Buffer,
    /// Attention's output, `[n, d]`.
    mixed: Buffer,
}

/// The output `[n, d]` for `x` `[n, d]`, and what to keep if `keep` asks for it.
pub fn forward(
    x: &[f32],
    weights: Weights<'_>,
    heads: Heads<'_>,
    keep: bool,
) -> (Buffer, Option<Intermediates>) {
    let (n, d) = (heads.layout.n_rows(), heads.d_model());
    let into_qkv = Panels::of(View::new(weights.qkv, 3 * d), d, 3 * d);
    let out_of = Panels::of(View::new(weights.output, d), d, d);
    let mut output = Buffer::new(n * d);
    let (mut qkv, mut mixed) = (Buffer::new(n * 3 * d), Buffer::new(n * d));
    let mut inverses = Buffer::new(n);
    let mut kept = Buffer::new(if keep { heads.n_kept() } else { 0 });
    let mut normed = Buffer::new(longest_chunk(heads.layout) * d);
    let (mut room, mut work) = (&mut kept[..], Workspace::default());
    for (sequences, rows) in chunks(heads.layout) {
        let inverses = &mut inverses[rows.clone()];
        rms_norm::forward(part(x, &rows, d), weights.gamma, weights.epsilon, &mut normed, inverses);
        let target = Target::new(part_mut(&mut qkv, &rows, 3 * d), 3 * d);
        multiply(target, rows.len(), View::new(&normed, d), &into_qkv, false);
        attend(&qkv, heads, sequences, &mut mixed, keep, &mut room, &mut work);
        let (output, mixed) = (part_mut(&mut output, &rows, d), part(&mixed, &rows, d));
        output.copy_from_slice(part(x, &rows, d));
        multiply(Target::new(output, d), rows.len(), View::new(mixed, d), &out_of, true);
    }
    (output, keep.then_some(Intermediates { inverses, qkv, statistics: kept, mixed }))
}

/// Turns the gradient by the output into that by `x`; gives those by γ, W_qkv and W_output.
pub fn backward(
    gradient: &mut [f32],
    x: &[f32],
    weights: Weights<'_>,
    heads: Heads<'_>,
    kept: Intermediates,
) -> [Buffer; 3] {
    let d = heads.d_model();
    let into_qkv = Panels::of(View::new(weights.qkv, 3 * d).transposed(), 3 * d, d);
    let out_of = Panels::of(View::new(weights.output, d).transposed(), d, d);
    let (mut by_gamma, mut by_output) = (Buffer::zeros(d), Buffer::zeros(d * d));
    // Transposed until the end, so that the narrower operand is the one that is copied.
    let mut by_weight = Buffer::zeros(3 * d * d);
    let longest = longest_chunk(heads.layout);
    let (mut normed, mut by_qkv) = (Buffer::new(longest * d), Buffer::new(longest * 3 * d));
    let (mut panels, mut work) = (Panels::default(), Workspace::default());
    let mut attended = &kept.statistics[..];
    for (sequences, rows) in chunks(heads.layout) {
        let (count, inverses) = (rows.len(), &kept.inverses[rows.clone()]);
        let (x, gradient) = (part(x, &rows, d), part_mut(gradient, &rows, d));
        let (mixed, change) = (View::new(part(&kept.mixed, &rows, d), d), View::new(gradient, d));
        add_transposed(Target::new(&mut by_output, d), (d, d), mixed, change, count, &mut panels);
        multiply(Target::new(&mut normed, d), count, change, &out_of, false);
        // Read in one go here, and never written: it has long left the cache.
        let by_qkv = &mut by_qkv[..count * 3 * d];
        by_qkv.copy_from_slice(part(&kept.qkv, &rows, 3 * d));
        let heads = Heads { first_row: rows.start, ..heads };
        attend_back(by_qkv, heads, sequences, &mut attended, &normed, &mut work);
        rms_norm::again(x, weights.gamma, inverses, &mut normed);
        let change = View::new(by_qkv, 3 * d);
        let (target, input) = (Target::new(&mut by_weight, d), View::new(&normed, d));
        add_transposed(target, (3 * d, d), change, input, count, &mut panels);
        multiply(Target::new(&mut normed, d), count, change, &into_qkv, false);
        rms_norm::backward(&mut normed, x, weights.gamma, inverses, &mut by_gamma, gradient);
    }
    [by_gamma, transposed(&by_weight, d), by_output]
}

/// Sequences, with their rows, in pieces of about [`CHUNK`] rows.
fn chunks(layout: &SequenceLayout) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
    let mut first = 0;
    std::iter::from_fn(move || {
        let start = layout.rows(first.min(layout.n_sequences() - 1)).start;
        let fits = |i: &usize| layout.rows(*i).end - start <= CHUNK;
        let more = (first + 1..layout.n_sequences()).take_while(fits).count();
        let sequences = first..first + 1 + more;
        let within = first < layout.n_sequences();
        first = sequences.end;
        within.then(|| (sequences.clone(), start..layout.rows(sequences.end - 1).end))
    })
}

/// Rows of the longest of [`chunks`].
fn longest_chunk(layout: &SequenceLayout) -> usize {
    chunks(layout).map(|(_, rows)| rows.len()).max().unwrap_or(0)
}
