//! The way back. Weights are made anew from the scores, to the same bits: that takes less time
//! than to have them written to memory and read again, and no memory.

use std::ops::Range;

use super::head_rows::{load, store};
use super::heads::Head;
use super::rotation::rotate_back;
use super::softmax::{self, Statistics, Tile};
use super::{Heads, Workspace};
use crate::ops::own::lanes::{Lanes, vectorised};
use crate::ops::own::product::{Span, block, product};
use crate::ops::own::scratch::ROWS;

vectorised! {
    /// Turns the rows of the sequences `sequences` of `qkv` into the gradient by them, given the
    /// gradient by the output and what [`forward`](super::forward()) kept, from whose front theirs is taken.
    pub fn backward(
        qkv: &mut [f32],
        heads: Heads<'_>,
        sequences: Range<usize>,
        kept: &mut &[f32],
        grad_output: &[f32],
        work: &mut Workspace,
    ) {
        for head in heads.each(sequences) {
            work.load::<L>(qkv, head);
            load_gradient::<L>(work, grad_output, head);
            for first in (0..head.len).step_by(ROWS) {
                differentiate::<L>(work, head, first, kept);
                let (to, rows) = ((&mut *qkv, head.part(0)), head.rows(first));
                rotate_back::<L>(to, &work.grad_queries, rows, head.angles(), head.scale());
            }
            store_keys_and_values::<L>(qkv, work, head);
        }
    }
}

/// Reads one head's gradient, and makes room.
#[inline(always)]
fn load_gradient<L: Lanes>(work: &mut Workspace, grad_output: &[f32], head: Head<'_>) {
    let (len, head_dim) = (head.len, head.head_dim());
    work.values_across.set_transposed::<L>(&work.values, len, head_dim);
    work.output.resize(len, head_dim);
    load::<L>(&mut work.output, (grad_output, head.output()), len);
    work.weights.resize(len, len);
    work.grad_scores.resize(len, len);
    work.grad_queries.resize(ROWS, head_dim);
}

/// Weights, gradient by the scores and gradient by the queries of one tile's rows.
#[inline(always)]
fn differentiate<L: Lanes>(work: &mut Workspace, head: Head<'_>, first: usize, kept: &mut &[f32]) {
    let (visible, head_dim) = (head.visible_in_tile(first), head.head_dim());
    let tile = Tile { first, visible: head.visible_by_row(first) };
    work.scores::<L>(head, first, first);
    softmax::again::<L>(&mut work.weights, tile, Statistics::take(head.rows(first).len(), kept));
    let by_weight = Span { inner: 0..head_dim, columns: visible };
    let output = work.output.plain().skip_rows(first);
    block::<L, _>(&mut work.grad_scores, first, output, &work.values_across, by_weight);
    softmax::backward::<L>(&mut work.grad_scores, &work.weights, tile);
    let by_query = Span { inner: 0..visible, columns: head_dim };
    let scores = work.grad_scores.plain().skip_rows(first);
    block::<L, _>(&mut work.grad_queries, 0, scores, &work.keys, by_query);
}

/// Writes one head's gradients over its keys and values.
#[inline(always)]
fn store_keys_and_values<L: Lanes>(qkv: &mut [f32], work: &mut Workspace, head: Head<'_>) {
    let (len, head_dim) = (head.len, head.head_dim());
    work.grad_keys.resize(len, head_dim);
    work.grad_values.resize(len, head_dim);
    let viewers = |first| Span { inner: head.first_viewer(first)..len, columns: head_dim };
    product::<L, _>(&mut work.grad_values, len, work.weights.transposed(), &work.output, viewers);
    product::<L, _>(
        &mut work.grad_keys,
        len,
        work.grad_scores.transposed(),
        &work.queries,
        viewers,
    );
    rotate_back::<L>((&mut *qkv, head.part(1)), &work.grad_keys, 0..len, head.angles(), 1.0);
    store::<L>((qkv, head.part(2)), 0..len, &work.grad_values);
}
