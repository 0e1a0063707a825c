//! Rotary, prefix-causal attention over packed sequences, one head of one sequence at a time.
//!
//! A position sees only a prefix of its sequence, so each row of the score matrix is cut at its end, and only the part
//! before the cut is computed: about half for a causal sequence. Rows go through scores, softmax and product one tile at
//! a time, and the backward pass recomputes their weights from two numbers per row.
//!
//! Rows of weights are zero from their cut to the end of the tile of keys that the cut of their tile's longest row lies in,
//! and on to the end of a vector. They are unspecified after it. That is enough: no product reads further.

use std::ops::Range;

use burn_flex::FlexTensor;

use super::buffers::{Buffer, dims, elements, elements_mut, part, part_mut};
use super::lanes::Lanes;
use super::matmul::{Start, Target, multiply, multiply_transposed};
use super::panels::{Panels, View, transposed};
use super::rows::{rms_norm, rms_norm_again, rms_norm_back};
use super::small_matrices::tile_rows;
use super::vectors::vectorised;
use super::{Above, Gradients, Operation};
use crate::ops::{AttentionOptions, SequenceLayout};
use heads::{Head, Heads, Sight, rotate, rotate_back};
use tiles::{Statistics, Workspace, differentiate, load_gradient, mix, sum_by_keys_and_values};

mod cross;
mod heads;
mod tiles;

impl AttentionOptions {
    /// The heads that they speak of.
    fn heads(&self) -> Heads<'_> {
        Heads { layout: &self.layout, rope: &self.rope, n_head: self.n_head, first_row: 0 }
    }
}

/// Numbers kept for the way back.
fn n_kept(heads: Heads<'_>) -> usize {
    Statistics::PER_ROW * heads.n_head * heads.layout.n_rows()
}

vectorised! {
    /// Attention of the sequences `sequences` of `qkv` `[n, 3 d]`, into their rows of `output`
    /// `[n, d]`. If `keep` is set, the statistics for [`attend_back`] go to the front of `room`, which advances.
    fn attend(
        qkv: &[f32],
        heads: Heads<'_>,
        sequences: Range<usize>,
        output: &mut [f32],
        keep: bool,
        room: &mut &mut [f32],
        work: &mut Workspace,
    ) {
        for head in heads.each(sequences) {
            load::<L>(work, qkv, head);
            mix::<L>(work, &head, (&mut *output, head.output()), keep, room);
        }
    }
}

vectorised! {
    /// Replaces the rows of the sequences `sequences` of `qkv` by the gradient by them, given the gradient by the output and
    /// the statistics kept by [`attend`], taken from the front.
    fn attend_back(
        qkv: &mut [f32],
        heads: Heads<'_>,
        sequences: Range<usize>,
        kept: &mut &[f32],
        grad_output: &[f32],
        work: &mut Workspace,
    ) {
        for head in heads.each(sequences) {
            let angles = Some(head.angles());
            load::<L>(work, qkv, head);
            load_gradient::<L>(work, (grad_output, head.output()), &head);
            for first in (0..head.len).step_by(tile_rows::<L>()) {
                differentiate::<L>(work, &head, first, kept);
                let (to, rows) = ((&mut *qkv, head.part(0)), head.rows::<L>(first));
                rotate_back::<L>(to, &work.grad_queries, rows, angles, head.scale());
            }
            sum_by_keys_and_values::<L>(work, &head);
            let to = (&mut *qkv, head.part(1));
            rotate_back::<L>(to, &work.grad_keys, 0..head.len, angles, 1.0);
            let to = (&mut *qkv, head.part(2));
            rotate_back::<L>(to, &work.grad_values, 0..head.len, None, 1.0);
        }
    }
}

/// Reads one head.
#[inline(always)]
fn load<L: Lanes>(work: &mut Workspace, qkv: &[f32], head: Head<'_>) {
    let (len, head_dim, scale) = (head.len, head.head_dim(), head.scale());
    let angles = Some(head.angles());
    for matrix in [&mut work.queries, &mut work.keys, &mut work.values] {
        matrix.resize::<L>(len, head_dim);
    }
    rotate::<L>(&mut work.queries, (qkv, head.part(0)), 0..len, angles, scale);
    rotate::<L>(&mut work.keys, (qkv, head.part(1)), 0..len, angles, 1.0);
    rotate::<L>(&mut work.values, (qkv, head.part(2)), 0..len, None, 1.0);
    work.keys_across.set_transposed::<L>(&work.keys, len, head_dim);
}

/// Attention alone, of `[q | k | v]`; keeps its input and the statistics to recompute its weights. See
/// [`Kernels::attend`](crate::ops::Kernels::attend).
impl Operation<1> for AttentionOptions {
    type Kept = (FlexTensor, Buffer);

    fn forward(&self, [qkv]: &[FlexTensor; 1], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let ([n, columns], heads) = (dims(qkv), self.heads());
        let mut mixed = Buffer::new(n * columns / 3);
        let mut statistics = Buffer::new(if keep { n_kept(heads) } else { 0 });
        let (sequences, mut room) = (0..heads.layout.n_sequences(), &mut statistics[..]);
        let work = &mut Workspace::default();
        attend(elements(qkv), heads, sequences, &mut mixed, keep, &mut room, work);
        (mixed.into_tensor([n, columns / 3]), keep.then(|| (qkv.clone(), statistics)))
    }

    fn backward(&self, (qkv, statistics): Self::Kept, (gradient, _): Above<1>) -> Gradients<1> {
        let (mut by, heads) = (Buffer::from_slice(elements(&qkv)), self.heads());
        let (sequences, mut kept) = (0..heads.layout.n_sequences(), &statistics[..]);
        let (change, work) = (elements(&gradient), &mut Workspace::default());
        attend_back(&mut by, heads, sequences, &mut kept, change, work);
        [Some(by.into_tensor(dims(&qkv)))]
    }
}

// The attention half of a block, a few sequences at a time: x + Attention(RMSNorm(x) W_qkv) W_output.
//
// Sequences are independent, so a chunk of them goes through the whole half while its intermediate results are in the
// cache.

/// Rows of a chunk, but for a longer sequence.
const CHUNK: usize = 192;

/// The data of the backward pass, besides the input.
#[derive(Clone, Debug)]
pub struct Intermediates {
    /// 1 / rms of each row.
    inverses: Buffer,
    /// Queries, keys and values before they are turned, `[n, 3 d]`.
    qkv: Buffer,
    /// The statistics that give attention's weights from its scores.
    statistics: Buffer,
    /// Attention's output, `[n, d]`.
    mixed: Buffer,
}

/// The attention half of a block, of x `[n, d]`, γ, W_qkv `[d, 3 d]` and W_output `[d, d]`; see
/// [`Kernels::attention`](crate::ops::Kernels::attention).
impl Operation<4> for AttentionOptions {
    type Kept = ([FlexTensor; 4], Intermediates);

    fn forward(&self, inputs: &[FlexTensor; 4], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let [x, gamma, w_qkv, w_output] = inputs.each_ref().map(elements);
        let ([n, d], heads) = (dims(&inputs[0]), self.heads());
        let into_qkv = Panels::of(View::new(w_qkv, 3 * d), d, 3 * d);
        let out_of = Panels::of(View::new(w_output, d), d, d);
        let mut output = Buffer::new(n * d);
        let (mut qkv, mut mixed) = (Buffer::new(n * 3 * d), Buffer::new(n * d));
        let mut inverses = Buffer::new(n);
        let mut statistics = Buffer::new(if keep { n_kept(heads) } else { 0 });
        let mut normed = Buffer::new(longest_chunk(heads.layout) * d);
        let (mut room, mut work) = (&mut statistics[..], Workspace::default());
        for (sequences, rows) in chunks(heads.layout) {
            let inverses = &mut inverses[rows.clone()];
            rms_norm(part(x, &rows, d), gamma, self.epsilon, &mut normed, inverses);
            let target = Target::new(part_mut(&mut qkv, &rows, 3 * d), 3 * d);
            multiply(target, rows.len(), View::new(&normed, d), &into_qkv, Start::Zero);
            attend(&qkv, heads, sequences, &mut mixed, keep, &mut room, &mut work);
            let (output, mixed) = (part_mut(&mut output, &rows, d), part(&mixed, &rows, d));
            let (target, from) =
                (Target::new(output, d), Start::Rows(View::new(part(x, &rows, d), d)));
            multiply(target, rows.len(), View::new(mixed, d), &out_of, from);
        }
        let kept = || (inputs.clone(), Intermediates { inverses, qkv, statistics, mixed });
        (output.into_tensor([n, d]), keep.then(kept))
    }

    fn backward(&self, (inputs, kept): Self::Kept, (mut gradient, _): Above<4>) -> Gradients<4> {
        let [x, gamma, w_qkv, w_output] = inputs.each_ref().map(elements);
        let (heads, d, by_x) = (self.heads(), gamma.len(), elements_mut(&mut gradient));
        let into_qkv = Panels::of(View::new(w_qkv, 3 * d).transposed(), 3 * d, d);
        let out_of = Panels::of(View::new(w_output, d).transposed(), d, d);
        let (mut by_gamma, mut by_output) = (Buffer::zeros(d), Buffer::new(d * d));
        // Transposed until the end, so that the narrower operand is the one that is copied.
        let mut by_weight = Buffer::new(3 * d * d);
        let longest = longest_chunk(heads.layout);
        let (mut normed, mut by_qkv) = (Buffer::new(longest * d), Buffer::new(longest * 3 * d));
        let (mut panels, mut work) = (Panels::default(), Workspace::default());
        let mut attended = &kept.statistics[..];
        for (sequences, rows) in chunks(heads.layout) {
            let (count, inverses) = (rows.len(), &kept.inverses[rows.clone()]);
            let (x, by_x) = (part(x, &rows, d), part_mut(by_x, &rows, d));
            let (mixed, change) = (View::new(part(&kept.mixed, &rows, d), d), View::new(by_x, d));
            let target = Target::new(&mut by_output, d);
            multiply_transposed(target, (d, d), mixed, change, &rows, &mut panels);
            multiply(Target::new(&mut normed, d), count, change, &out_of, Start::Zero);
            // Read in one go here, and never written: it has long left the cache.
            let by_qkv = &mut by_qkv[..count * 3 * d];
            by_qkv.copy_from_slice(part(&kept.qkv, &rows, 3 * d));
            let heads = Heads { first_row: rows.start, ..heads };
            attend_back(by_qkv, heads, sequences, &mut attended, &normed, &mut work);
            rms_norm_again(x, gamma, inverses, &mut normed);
            let change = View::new(by_qkv, 3 * d);
            let (target, input) = (Target::new(&mut by_weight, d), View::new(&normed, d));
            multiply_transposed(target, (3 * d, d), change, input, &rows, &mut panels);
            multiply(Target::new(&mut normed, d), count, change, &into_qkv, Start::Zero);
            rms_norm_back(&mut normed, x, gamma, inverses, &mut by_gamma, by_x);
        }
        drop(inputs);
        let by_qkv = transposed(&by_weight, d).into_tensor([d, 3 * d]);
        [gradient, by_gamma.into_tensor([d]), by_qkv, by_output.into_tensor([d, d])].map(Some)
    }
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
