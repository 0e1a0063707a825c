//! [`Growing`]: sequences that grow, each pass over the new positions alone.
//!
//! Text prefixes stand side by side, padded at their ends; no position sees the padding. So what comes
//! out is what a whole pass over `[text | motion]` gives.
//!
//! Shapes: b sequences, p positions of the longest text, m positions that join each, d width.

use burn::tensor::Tensor;

use super::block::Block;
use super::layers::{Backbone, EPSILON};
use crate::ops::{Joining, KeyValues};

/// Sequences of text and what came after it.
pub struct Growing<'a> {
    backbone: &'a Backbone,
    blocks: &'a [Block],
    /// Keys and values, one entry a block.
    kept: Vec<KeyValues>,
    /// Text positions of each sequence.
    prefixes: Vec<usize>,
    /// Positions of each after the longest text.
    joined: usize,
}

impl<'a> Growing<'a> {
    /// Sequences of so many text positions each, at least one, which [`Growing::join`] takes first.
    pub fn new(backbone: &'a Backbone, blocks: &'a [Block], prefixes: Vec<usize>) -> Self {
        let kept = vec![KeyValues::default(); blocks.len()];
        Self { backbone, blocks, kept, prefixes, joined: 0 }
    }

    /// p.
    pub fn longest_text(&self) -> usize {
        self.prefixes.iter().copied().max().unwrap_or(0)
    }

    /// Text positions of each sequence.
    pub fn prefixes(&self) -> &[usize] {
        &self.prefixes
    }

    /// What the blocks make of the texts, padded to p positions each, `[b·p, d]`; their angles by their
    /// places among those of the rope, `[b·p]`.
    pub fn text(&mut self, x_nd: Tensor<2>, angles: &[usize]) -> Tensor<2> {
        self.pass(x_nd, self.joining(angles))
    }

    /// What the blocks make of m positions that join each sequence, `[b·m, d]`, given their angles,
    /// `[b·m]`; each sees all before it and those that join beside it, but no text where it is `blind`,
    /// `[b·m]` or empty.
    pub fn join(&mut self, x_nd: Tensor<2>, angles: &[usize], blind: &[bool]) -> Tensor<2> {
        self.joined += angles.len() / self.prefixes.len();
        let joining = self.joining(angles);
        let sees_all = !blind.contains(&true);
        let p = self.longest_text();
        self.pass(x_nd, if sees_all { joining } else { joining.hiding(p, blind) })
    }

    fn pass(&mut self, x_nd: Tensor<2>, joining: Joining) -> Tensor<2> {
        self.blocks.iter().zip(&mut self.kept).fold(x_nd, |x_nd, (block, kept)| {
            let x_nd = joining.attention(x_nd, block.attention(), kept, EPSILON);
            self.backbone.feed_forward(block, x_nd)
        })
    }

    fn joining(&self, angles: &[usize]) -> Joining {
        let p = self.longest_text();
        let is_padding = |prefix: &usize| {
            let prefix = *prefix;
            (0..p + self.joined).map(move |slot| slot >= prefix && slot < p)
        };
        let padding: Vec<bool> = self.prefixes.iter().flat_map(is_padding).collect();
        let Backbone { rope, shape, device, .. } = self.backbone;
        Joining::new(rope, shape.n_head, self.prefixes.len(), angles, &padding, device)
    }
}

/// Rows side by side, each filled up with zeros to `width`.
pub fn padded(rows: &[&[f32]], width: usize) -> Vec<f32> {
    let mut values = vec![0.0; rows.len() * width];
    for (to, from) in values.chunks_exact_mut(width).zip(rows) {
        to[..from.len()].copy_from_slice(from);
    }
    values
}
