//! The way forward: scores, softmax, weighted values.

use std::ops::Range;

use super::rotation::rotate;
use super::{Head, Heads, Workspace};
use crate::ops::own::lanes::{LANES, Lanes, vectorised};
use crate::ops::own::maths::{copy, exp, max};
use crate::ops::own::product::{Span, product};

vectorised! {
    /// Attention of the sequences `sequences` of `qkv` `[n, 3 d]`, into their rows of `output`
    /// `[n, d]`. If `keep` asks for it, the weights that are not masked go to the front of
    /// `room`, row after row, and it moves on.
    pub fn forward(
        qkv: &[f32],
        heads: Heads<'_>,
        sequences: Range<usize>,
        output: &mut [f32],
        keep: bool,
        room: &mut &mut [f32],
        work: &mut Workspace,
    ) {
        for head in heads.each(sequences) {
            load_forward::<L>(work, qkv, head);
            attend::<L>(work, head);
            if keep {
                keep_weights::<L>(room, work, head);
            }
            store_output::<L>(output, work, head);
        }
    }
}

/// Reads one head: rotated queries, rotated keys transposed, values.
#[inline(always)]
fn load_forward<L: Lanes>(work: &mut Workspace, qkv: &[f32], head: Head<'_>) {
    let (len, head_dim, scale) = (head.len(), head.head_dim(), head.scale());
    work.queries.resize(len, head_dim);
    work.turned.resize(1, head_dim);
    work.keys.resize(head_dim, len);
    work.values.resize(len, head_dim);
    for t in 0..len {
        let angles = head.heads.rope.at(t);
        rotate::<L>(&mut work.queries.row_mut(t)[..head_dim], head.part(0, t, qkv), angles, scale);
        rotate::<L>(&mut work.turned.row_mut(0)[..head_dim], head.part(1, t, qkv), angles, 1.0);
        work.keys.set_column(t, &work.turned.row(0)[..head_dim]);
        copy::<L>(&mut work.values.row_mut(t)[..head_dim], head.part(2, t, qkv));
    }
}

/// weights = softmax(queries keys), output = weights values.
#[inline(always)]
fn attend<L: Lanes>(work: &mut Workspace, head: Head<'_>) {
    let (len, head_dim) = (head.len(), head.head_dim());
    work.weights.resize(len, len);
    work.output.resize(len, head_dim);
    product::<L>(&mut work.weights, len, work.queries.plain(), &work.keys, |first| Span {
        inner: 0..head_dim,
        columns: head.visible_in_tile(first),
    });
    for q in 0..len {
        softmax::<L>(work.weights.row_mut(q), head.visible(q));
    }
    product::<L>(&mut work.output, len, work.weights.plain(), &work.values, |first| Span {
        inner: 0..head.visible_in_tile(first),
        columns: head_dim,
    });
}

/// Softmax of the first `visible` elements of a row, with zeros to the end of their last vector.
#[inline(always)]
fn softmax<L: Lanes>(row: &mut [f32], visible: usize) {
    let largest = L::splat(max::<L>(&row[..visible]));
    let row = row[..visible.next_multiple_of(LANES)].as_chunks_mut().0;
    let mut sum = L::splat(0.0);
    for (i, x) in row.iter_mut().enumerate() {
        let power = exp(L::load(x).sub(largest)).first(visible - i * LANES, L::splat(0.0));
        power.store(x);
        sum = sum.add(power);
    }
    let inverse = L::splat(1.0 / sum.sum());
    for x in row {
        L::load(x).mul(inverse).store(x);
    }
}

/// Copies one head's weights to the front of `kept`, which moves on.
#[inline(always)]
fn keep_weights<L: Lanes>(kept: &mut &mut [f32], work: &Workspace, head: Head<'_>) {
    for q in 0..head.len() {
        let whole = head.visible(q).next_multiple_of(LANES);
        let (row, rest) = std::mem::take(kept).split_at_mut(whole);
        copy::<L>(row, &work.weights.row(q)[..whole]);
        *kept = rest;
    }
}

/// Writes one head's output to its place.
#[inline(always)]
fn store_output<L: Lanes>(output: &mut [f32], work: &Workspace, head: Head<'_>) {
    let head_dim = head.head_dim();
    for t in 0..head.len() {
        let target = &mut output[head.output_start(t)..][..head_dim];
        copy::<L>(target, &work.output.row(t)[..head_dim]);
    }
}
