//! [`Workspace`]: the matrices of one head.

use super::heads::Head;
use super::rotation::rotate;
use super::sight::Sight;
use crate::ops::own::lanes::Lanes;
use crate::ops::own::product::{Span, block};
use crate::ops::own::scratch::Scratch;

/// Matrices of one head, kept from head to head for their allocations.
#[derive(Default)]
pub struct Workspace {
    /// Rotated and scaled, `[queries, head_dim]`.
    pub(super) queries: Scratch,
    /// Rotated, `[keys, head_dim]`.
    pub(super) keys: Scratch,
    /// The same transposed.
    pub(super) keys_across: Scratch,
    /// `[keys, head_dim]`.
    pub(super) values: Scratch,
    /// The same transposed.
    pub(super) values_across: Scratch,
    /// Softmax of the scores, of one tile on the way forward, `[queries, keys]` on the way back; each
    /// row to the end of the vector it is cut in.
    pub(super) weights: Scratch,
    /// Gradient by the weights, then by the scores, `[queries, keys]`.
    pub(super) grad_scores: Scratch,
    /// The output of one tile on the way forward, the gradient by it `[queries, head_dim]` back.
    pub(super) output: Scratch,
    /// Gradients by the rotated queries of one tile, and by keys and values, `[keys, head_dim]`.
    pub(super) grad_queries: Scratch,
    pub(super) grad_keys: Scratch,
    pub(super) grad_values: Scratch,
}

impl Workspace {
    /// Reads one head.
    #[inline(always)]
    pub(super) fn load<L: Lanes>(&mut self, qkv: &[f32], head: Head<'_>) {
        let (len, head_dim, scale) = (head.len, head.head_dim(), head.scale());
        let angles = Some(head.angles());
        for matrix in [&mut self.queries, &mut self.keys, &mut self.values] {
            matrix.resize(len, head_dim);
        }
        rotate::<L>(&mut self.queries, (qkv, head.part(0)), 0..len, angles, scale);
        rotate::<L>(&mut self.keys, (qkv, head.part(1)), 0..len, angles, 1.0);
        rotate::<L>(&mut self.values, (qkv, head.part(2)), 0..len, None, 1.0);
        self.keys_across.set_transposed::<L>(&self.keys, len, head_dim);
    }

    /// The scores of the tile that starts at row `first`, into the rows of `weights` from `to` on.
    #[inline(always)]
    pub(super) fn scores<L: Lanes>(&mut self, sight: &impl Sight, first: usize, to: usize) {
        let span = Span { inner: 0..sight.head_dim(), columns: sight.visible_in_tile(first) };
        let queries = self.queries.plain().skip_rows(first);
        block::<L, _>(&mut self.weights, to, queries, &self.keys_across, span);
    }
}
