//! The way back, from the weights that the way forward kept.

use std::ops::Range;

use super::rotation::{rotate, rotate_back};
use super::{Head, Heads, Workspace};
use crate::ops::own::lanes::{LANES, Lanes, vectorised};
use crate::ops::own::maths::{copy, dot};
use crate::ops::own::product::{Span, product};

vectorised! {
    /// Turns the rows of the sequences `sequences` of `qkv` into the gradient by them, given the
    /// weights that [`super::forward`] kept, from whose front those read are taken, and the
    /// gradient by the output.
    pub fn backward(
        qkv: &mut [f32],
        heads: Heads<'_>,
        sequences: Range<usize>,
        kept: &mut &[f32],
        grad_output: &[f32],
        work: &mut Workspace,
    ) {
        for head in heads.each(sequences) {
            load_backward::<L>(work, qkv, grad_output, head);
            load_weights::<L>(work, kept, head);
            differentiate::<L>(work, head);
            store_gradients::<L>(qkv, work, head);
        }
    }
}

/// Reads one head: rotated queries and keys, values transposed, gradient by the output.
#[inline(always)]
fn load_backward<L: Lanes>(work: &mut Workspace, qkv: &[f32], grad_output: &[f32], head: Head<'_>) {
    let (len, head_dim, scale) = (head.len(), head.head_dim(), head.scale());
    work.queries.resize(len, head_dim);
    work.keys.resize(len, head_dim);
    work.values.resize(head_dim, len);
    work.output.resize(len, head_dim);
    for t in 0..len {
        let angles = head.heads.rope.at(t);
        rotate::<L>(&mut work.queries.row_mut(t)[..head_dim], head.part(0, t, qkv), angles, scale);
        rotate::<L>(&mut work.keys.row_mut(t)[..head_dim], head.part(1, t, qkv), angles, 1.0);
        work.values.set_column(t, head.part(2, t, qkv));
        let gradient = &grad_output[head.output_start(t)..][..head_dim];
        copy::<L>(&mut work.output.row_mut(t)[..head_dim], gradient);
    }
}

/// Takes one head's weights from the front of `kept`.
#[inline(always)]
fn load_weights<L: Lanes>(work: &mut Workspace, kept: &mut &[f32], head: Head<'_>) {
    let len = head.len();
    work.weights.resize(len, len);
    for q in 0..len {
        let (row, rest) = kept.split_at(head.visible(q).next_multiple_of(LANES));
        copy::<L>(&mut work.weights.row_mut(q)[..row.len()], row);
        *kept = rest;
    }
}

/// The five products of the way back, and softmax's own.
#[inline(always)]
fn differentiate<L: Lanes>(work: &mut Workspace, head: Head<'_>) {
    let (len, head_dim) = (head.len(), head.head_dim());
    work.grad_scores.resize(len, len);
    for gradient in [&mut work.grad_queries, &mut work.grad_keys, &mut work.grad_values] {
        gradient.resize(len, head_dim);
    }
    let seen_by = |first| Span { inner: 0..head.visible_in_tile(first), columns: head_dim };
    let viewers_of = |first| Span { inner: head.first_viewer(first)..len, columns: head_dim };
    let (weights, output) = (&work.weights, &work.output);
    product::<L>(&mut work.grad_values, len, weights.transposed(), output, viewers_of);
    product::<L>(&mut work.grad_scores, len, output.plain(), &work.values, |first| Span {
        inner: 0..head_dim,
        columns: head.visible_in_tile(first),
    });
    for q in 0..len {
        softmax_back::<L>(work.grad_scores.row_mut(q), weights.row(q), head.visible(q));
    }
    let scores = &work.grad_scores;
    product::<L>(&mut work.grad_queries, len, scores.plain(), &work.keys, seen_by);
    product::<L>(&mut work.grad_keys, len, scores.transposed(), &work.queries, viewers_of);
}

/// Gradient by a row of scores from the gradient by its weights: wᵢ (gᵢ − Σⱼ wⱼ gⱼ).
#[inline(always)]
fn softmax_back<L: Lanes>(gradient: &mut [f32], weights: &[f32], visible: usize) {
    let mean = L::splat(dot::<L>(&gradient[..visible], weights));
    let gradient = gradient[..visible.next_multiple_of(LANES)].as_chunks_mut().0;
    for (i, (gradient, weight)) in gradient.iter_mut().zip(weights.as_chunks().0).enumerate() {
        let by_score = L::load(gradient).sub(mean).mul(L::load(weight));
        by_score.first(visible - i * LANES, L::splat(0.0)).store(gradient);
    }
}

/// Writes one head's gradients over its queries, keys and values.
#[inline(always)]
fn store_gradients<L: Lanes>(qkv: &mut [f32], work: &Workspace, head: Head<'_>) {
    let (head_dim, scale) = (head.head_dim(), head.scale());
    for t in 0..head.len() {
        let angles = head.heads.rope.at(t);
        let target = &mut qkv[head.start(0, t)..][..head_dim];
        rotate_back::<L>(target, &work.grad_queries.row(t)[..head_dim], angles, scale);
        let target = &mut qkv[head.start(1, t)..][..head_dim];
        rotate_back::<L>(target, &work.grad_keys.row(t)[..head_dim], angles, 1.0);
        let target = &mut qkv[head.start(2, t)..][..head_dim];
        copy::<L>(target, &work.grad_values.row(t)[..head_dim]);
    }
}
