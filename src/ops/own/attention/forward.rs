//! The way forward: scores, softmax, weighted values.

use std::ops::Range;

use super::head_rows::store;
use super::heads::Head;
use super::softmax::{self, Statistics, Tile};
use super::{Heads, Workspace};
use crate::ops::own::lanes::{Lanes, vectorised};
use crate::ops::own::product::{Span, block};
use crate::ops::own::scratch::ROWS;

vectorised! {
    /// Attention of the sequences `sequences` of `qkv` `[n, 3 d]`, into their rows of `output`
    /// `[n, d]`. If `keep` asks for it, what [`backward`](super::backward()) makes the weights from again
    /// goes to the front of `room`, and it moves on.
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
            work.load::<L>(qkv, head);
            work.weights.resize(ROWS, head.len);
            work.output.resize(ROWS, head.head_dim());
            for first in (0..head.len).step_by(ROWS) {
                let statistics = attend::<L>(work, head, first);
                if keep {
                    statistics.keep(head.rows(first).len(), room);
                }
                store::<L>((output, head.output()), head.rows(first), &work.output);
            }
        }
    }
}

/// weights = softmax(queries keysᵀ), output = weights values, for the rows of one tile.
#[inline(always)]
fn attend<L: Lanes>(work: &mut Workspace, head: Head<'_>, first: usize) -> Statistics {
    let visible = head.visible_in_tile(first);
    work.scores::<L>(head, first, 0);
    let tile = Tile { first: 0, visible: head.visible_by_row(first) };
    let statistics = softmax::forward::<L>(&mut work.weights, tile);
    let span = Span { inner: 0..visible, columns: head.head_dim() };
    block::<L, _>(&mut work.output, 0, work.weights.plain(), &work.values, span);
    statistics
}
