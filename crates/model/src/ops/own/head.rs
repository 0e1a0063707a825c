//! The head and its loss: mean cross-entropy of softmax(RMSNorm(x) W), a chunk of rows at a time.
//!
//! No tensor of all logits exists. A chunk's logits are made block of columns by block of columns,
//! each block going into the row's log-normaliser while it is in the cache; once that is known, a
//! second pass over the blocks turns them into gradients and multiplies them on. So the gradients
//! are ready as soon as the loss is, and the way back only hands them out.

use std::ops::Range;

use super::buffers::Buffer;
use super::cross_entropy::{LogSum, add_block, gradient_block};
use super::feed_forward::{chunks, part, part_mut};
use super::lanes::LANES;
use super::matmul::{Panels, Target, View, add_transposed, multiply_part};
use super::rms_norm;

/// Rows of a chunk.
const CHUNK: usize = 256;

/// Columns of a block, about.
const BLOCK: usize = 512;

/// The input and the parameters, row-major.
#[derive(Clone, Copy)]
pub struct Head<'a> {
    /// `[s, d]`.
    pub x: &'a [f32],
    /// `[d]`.
    pub gamma: &'a [f32],
    /// `[d, v]`.
    pub weight: &'a [f32],
    pub epsilon: f32,
    /// `[s]`.
    pub targets: &'a [u32],
}

/// Room for one chunk.
struct Room {
    normed: Buffer,
    /// Block after block, each of rows of [`stride`] elements.
    logits: Buffer,
    inverses: Buffer,
    sums: Vec<LogSum>,
}

impl Head<'_> {
    fn d(&self) -> usize {
        self.gamma.len()
    }

    fn n_vocab(&self) -> usize {
        self.weight.len() / self.d()
    }

    /// Blocks of columns of one width, but for the last.
    fn blocks(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let n = self.n_vocab();
        let width = n.div_ceil(n.div_ceil(BLOCK + BLOCK / 8)).next_multiple_of(32);
        chunks(n, width)
    }

    fn room(&self, columns: usize) -> Room {
        let rows = CHUNK.min(self.targets.len());
        Room {
            normed: Buffer::new(rows * self.d()),
            logits: Buffer::new(rows * columns),
            inverses: Buffer::new(rows),
            sums: Vec::with_capacity(rows),
        }
    }

    /// −ln p of each row's target, in nats.
    pub fn losses(&self) -> Vec<f64> {
        let panels = Panels::of(View::new(self.weight, self.n_vocab()), self.d(), self.n_vocab());
        let mut room = self.room(self.blocks().map(|block| stride(&block)).max().unwrap_or(0));
        let mut losses = Vec::with_capacity(self.targets.len());
        for rows in chunks(self.targets.len(), CHUNK) {
            self.look(&rows, &panels, &mut room, false);
            losses.extend(room.sums.iter().map(LogSum::loss));
        }
        losses
    }

    /// −ln p of each row's target, in nats, and the gradients of their mean by x, γ and W.
    pub fn losses_and_gradients(&self) -> (Vec<f64>, [Buffer; 3]) {
        let (d, v) = (self.d(), self.n_vocab());
        let there = Panels::of(View::new(self.weight, v), d, v);
        let back = Panels::of(View::new(self.weight, v).transposed(), v, d);
        let mut by = [self.x.len(), d, d * v].map(Buffer::zeros);
        let columns = self.blocks().map(|block| stride(&block)).sum();
        let (mut room, mut panels) = (self.room(columns), Panels::default());
        let mut losses = Vec::with_capacity(self.targets.len());
        for rows in chunks(self.targets.len(), CHUNK) {
            self.look(&rows, &there, &mut room, true);
            losses.extend(room.sums.iter().map(LogSum::loss));
            self.learn(&rows, &back, &mut room, &mut by, &mut panels);
        }
        (losses, by)
    }

    /// Normalises a chunk and sums its softmax; keeps its logits if `keep` asks for it.
    fn look(&self, rows: &Range<usize>, panels: &Panels, room: &mut Room, keep: bool) {
        let (d, count) = (self.d(), rows.len());
        let Room { normed, logits, inverses, sums } = room;
        rms_norm::forward(part(self.x, rows, d), self.gamma, self.epsilon, normed, inverses);
        sums.clear();
        sums.resize(count, LogSum::default());
        for block in self.blocks() {
            let start = if keep { block.start * count } else { 0 };
            let logits = &mut logits[start..][..count * stride(&block)];
            let target = Target::new(logits, stride(&block));
            multiply_part(target, count, View::new(normed, d), panels, block.clone(), 0..d, false);
            add_block(logits, block, &self.targets[rows.clone()], sums);
        }
    }

    /// Adds a chunk's share to the gradients.
    fn learn(
        &self,
        rows: &Range<usize>,
        back: &Panels,
        room: &mut Room,
        [by_x, by_gamma, by_weight]: &mut [Buffer; 3],
        panels: &mut Panels,
    ) {
        let (d, v, count) = (self.d(), self.n_vocab(), rows.len());
        let Room { normed, logits, inverses, sums } = room;
        let scale = 1.0 / self.targets.len() as f32;
        let mut change = Buffer::zeros(count * d);
        for block in self.blocks() {
            let logits = &mut logits[block.start * count..][..count * stride(&block)];
            gradient_block(logits, block.clone(), &self.targets[rows.clone()], sums, scale);
            let by_logits = View::new(logits, stride(&block));
            let target = Target::new(&mut change, d);
            multiply_part(target, count, by_logits, back, 0..d, block.clone(), true);
            let target = Target::new(&mut by_weight[block.start..], v);
            let (size, normed) = ((d, block.len()), View::new(normed, d));
            add_transposed(target, size, normed, by_logits, count, panels);
        }
        let (x, to) = (part(self.x, rows, d), part_mut(by_x, rows, d));
        rms_norm::backward(&mut change, x, self.gamma, inverses, by_gamma, to);
    }
}

/// Elements from row to row of a block: whole vectors.
fn stride(block: &Range<usize>) -> usize {
    block.len().next_multiple_of(LANES)
}
