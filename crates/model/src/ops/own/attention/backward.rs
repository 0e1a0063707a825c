//! The way back. Weights are made anew from the scores, to the same bits: that takes less time
//! than to have them written to memory and read again, and no memory.

use std::ops::Range;

use super::head_rows::HeadRows;
use super::rotation::{rotate, rotate_back};
use super::sight::Sight;
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
            let angles = Some(head.angles());
            work.load::<L>(qkv, head);
            load_gradient::<L>(work, (grad_output, head.output()), &head);
            for first in (0..head.len).step_by(ROWS) {
                differentiate::<L>(work, &head, first, kept);
                let (to, rows) = ((&mut *qkv, head.part(0)), head.rows(first));
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

/// Reads one head's gradient, and makes room.
#[inline(always)]
pub fn load_gradient<L: Lanes>(
    work: &mut Workspace,
    gradient: (&[f32], HeadRows),
    sight: &impl Sight,
) {
    let (queries, keys, head_dim) = (sight.n_queries(), sight.n_keys(), sight.head_dim());
    work.values_across.set_transposed::<L>(&work.values, keys, head_dim);
    work.output.resize(queries, head_dim);
    rotate::<L>(&mut work.output, gradient, 0..queries, None, 1.0);
    work.weights.resize(queries, keys);
    work.grad_scores.resize(queries, keys);
    work.grad_queries.resize(ROWS, head_dim);
}

/// Weights, gradient by the scores and gradient by the queries of one tile's rows.
#[inline(always)]
pub fn differentiate<L: Lanes>(
    work: &mut Workspace,
    sight: &impl Sight,
    first: usize,
    kept: &mut &[f32],
) {
    let (visible, head_dim) = (sight.visible_in_tile(first), sight.head_dim());
    let tile = Tile { first, visible: sight.visible_by_row(first) };
    work.scores::<L>(sight, first, first);
    softmax::again::<L>(&mut work.weights, tile, Statistics::take(sight.rows(first).len(), kept));
    let by_weight = Span { inner: 0..head_dim, columns: visible };
    let output = work.output.plain().skip_rows(first);
    block::<L, _>(&mut work.grad_scores, first, output, &work.values_across, by_weight);
    softmax::backward::<L>(&mut work.grad_scores, &work.weights, tile);
    let by_query = Span { inner: 0..visible, columns: head_dim };
    let scores = work.grad_scores.plain().skip_rows(first);
    block::<L, _>(&mut work.grad_queries, 0, scores, &work.keys, by_query);
}

/// Gradients of one head by its turned keys and by its values.
#[inline(always)]
pub fn sum_by_keys_and_values<L: Lanes>(work: &mut Workspace, sight: &impl Sight) {
    let (queries, keys, head_dim) = (sight.n_queries(), sight.n_keys(), sight.head_dim());
    work.grad_keys.resize(keys, head_dim);
    work.grad_values.resize(keys, head_dim);
    let viewers = |first| Span { inner: sight.first_viewer(first)..queries, columns: head_dim };
    let (weights, scores) = (work.weights.transposed(), work.grad_scores.transposed());
    product::<L, _>(&mut work.grad_values, keys, weights, &work.output, viewers);
    product::<L, _>(&mut work.grad_keys, keys, scores, &work.queries, viewers);
}
