//! The head and its loss: mean cross-entropy of softmax(RMSNorm(x) W), a chunk of rows at a time.
//!
//! No tensor of all logits exists. A chunk's logits are made block of columns by block of columns,
//! each block going into the row's log-normaliser while it is in the cache; once that is known, a
//! second pass over the blocks turns them into gradients and multiplies them on. So the gradients
//! are ready as soon as the loss is, and the way back only hands them out.

use std::ops::Range;
use std::sync::Arc;

use burn_flex::FlexTensor;

use super::buffers::{
    AHEAD, Buffer, chunks, contiguous, elements, part, part_mut, prefetch, tensor,
};
use super::lanes::{LANES, Lanes};
use super::matmul::{Start, Target, multiply_part, multiply_transposed};
use super::panels::{Panels, View, transposed};
use super::rows::{exp_below_88, max, rms_norm, rms_norm_back, sum_of_exp};
use super::vectors::vectorised;
use super::{Above, Gradients, Operation};
use crate::ops::RowLosses;

/// The head's loss, of x, γ and W; keeps the gradients, which are made on the way forward. See
/// [`Kernels::head_loss`](crate::ops::Kernels::head_loss).
#[derive(Clone, Debug)]
pub struct HeadLoss {
    pub targets: Arc<[u32]>,
    pub epsilon: f32,
}

impl HeadLoss {
    fn head<'a>(&'a self, inputs: &'a [FlexTensor; 3]) -> Head<'a> {
        let [x, gamma, weight] = inputs.each_ref().map(elements);
        Head { x, gamma, weight, epsilon: self.epsilon, targets: &self.targets }
    }

    /// The rows' losses and likeliest columns, outside autodiff.
    pub fn rows_losses(&self, inputs: [FlexTensor; 3]) -> RowLosses {
        self.head(&inputs.map(contiguous)).losses(false).0
    }
}

impl Operation<3> for HeadLoss {
    type Kept = [Buffer; 3];

    fn forward(&self, inputs: &[FlexTensor; 3], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let (losses, gradients) = self.head(inputs).losses(keep);
        let mean = losses.nats.iter().sum::<f64>() / losses.nats.len() as f64;
        (tensor(vec![mean as f32], [1]), gradients)
    }

    fn backward(&self, by: Self::Kept, (gradient, _): Above<3>) -> Gradients<3> {
        let above = elements(&gradient)[0];
        let [x, gamma, weight] = by.map(|by| scaled(by, above));
        let d = gamma.len();
        let (of_x, of_weight) = ([x.len() / d, d], [d, weight.len() / d]);
        [x.into_tensor(of_x), gamma.into_tensor([d]), weight.into_tensor(of_weight)].map(Some)
    }
}

/// Multiplies a gradient by the one that comes from above, which is 1 for the loss itself.
fn scaled(mut gradient: Buffer, by: f32) -> Buffer {
    if by != 1.0 {
        gradient.iter_mut().for_each(|x| *x *= by);
    }
    gradient
}

/// Rows of a chunk: whole tiles of any kind.
const CHUNK: usize = 264;

/// Columns of a block, about.
const BLOCK: usize = 512;

/// The input and the parameters, row-major.
#[derive(Clone, Copy)]
struct Head<'a> {
    /// `[s, d]`.
    x: &'a [f32],
    /// `[d]`.
    gamma: &'a [f32],
    /// `[d, v]`.
    weight: &'a [f32],
    epsilon: f32,
    /// `[s]`.
    targets: &'a [u32],
}

/// Room for one chunk.
struct Room {
    normed: Buffer,
    /// Block after block, each of rows of [`stride`] elements.
    logits: Buffer,
    inverses: Buffer,
    sums: Vec<LogSum>,
}

/// The inputs of the gradients.
struct Learning {
    /// W, for the way back.
    back: Panels,
    /// Room for the right operand of a product.
    panels: Panels,
    /// Gradients by x, γ and Wᵀ so far: W is wide, so that the narrower operand is the one that is copied.
    by: [Buffer; 3],
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

    /// −ln p of each row's target, in nats, with the gradients of their mean by x, γ and W if they are wanted, and
    /// otherwise with each row's likeliest column.
    fn losses(&self, wants_gradients: bool) -> (RowLosses, Option<[Buffer; 3]>) {
        let (n, d, v) = (self.targets.len(), self.d(), self.n_vocab());
        let there = Panels::of(View::new(self.weight, v), d, v);
        let columns = self.blocks().map(|block| stride(&block));
        let columns = if wants_gradients { columns.sum() } else { columns.max().unwrap_or(0) };
        let rows = CHUNK.min(n);
        let mut room = Room {
            normed: Buffer::new(rows * d),
            logits: Buffer::new(rows * columns),
            inverses: Buffer::new(rows),
            sums: Vec::with_capacity(rows),
        };
        let mut learning = wants_gradients.then(|| Learning {
            back: Panels::of(View::new(self.weight, v).transposed(), v, d),
            panels: Panels::default(),
            by: [Buffer::zeros(self.x.len()), Buffer::zeros(d), Buffer::new(d * v)],
        });
        let mut losses = RowLosses::default();
        for rows in chunks(n, CHUNK) {
            self.look(&rows, &there, &mut room, wants_gradients);
            losses.nats.extend(room.sums.iter().map(LogSum::loss));
            match &mut learning {
                Some(learning) => self.learn(&rows, &mut room, learning),
                None => losses.likeliest.extend(room.sums.iter().map(|sum| sum.likeliest)),
            }
        }
        let by = learning.map(|Learning { by: [by_x, by_gamma, by_weight], .. }| {
            [by_x, by_gamma, transposed(&by_weight, d)]
        });
        (losses, by)
    }

    /// Normalises a chunk and sums its softmax; keeps its logits if `keep` asks for it, and otherwise finds the largest.
    fn look(&self, rows: &Range<usize>, panels: &Panels, room: &mut Room, keep: bool) {
        let (d, count) = (self.d(), rows.len());
        let Room { normed, logits, inverses, sums } = room;
        rms_norm(part(self.x, rows, d), self.gamma, self.epsilon, normed, inverses);
        sums.clear();
        sums.resize(count, LogSum::default());
        for block in self.blocks() {
            let start = if keep { block.start * count } else { 0 };
            let logits = &mut logits[start..][..count * stride(&block)];
            let (target, normed) = (Target::new(logits, stride(&block)), View::new(normed, d));
            multiply_part(target, count, normed, panels, block.clone(), 0..d, Start::Zero);
            add_block(logits, block, &self.targets[rows.clone()], sums, !keep);
        }
    }

    /// Adds a chunk's share to the gradients.
    fn learn(&self, rows: &Range<usize>, room: &mut Room, learning: &mut Learning) {
        let Learning { back, panels, by: [by_x, by_gamma, by_weight] } = learning;
        let (d, count) = (self.d(), rows.len());
        let Room { normed, logits, inverses, sums } = room;
        let scale = 1.0 / self.targets.len() as f32;
        let mut change = Buffer::new(count * d);
        for block in self.blocks() {
            let logits = &mut logits[block.start * count..][..count * stride(&block)];
            gradient_block(logits, block.clone(), &self.targets[rows.clone()], sums, scale);
            let by_logits = View::new(logits, stride(&block));
            let target = Target::new(&mut change, d);
            let start = if block.start > 0 { Start::Target } else { Start::Zero };
            multiply_part(target, count, by_logits, back, 0..d, block.clone(), start);
            let target = Target::new(&mut by_weight[block.start * d..], d);
            let (size, normed) = ((block.len(), d), View::new(normed, d));
            multiply_transposed(target, size, by_logits, normed, rows, panels);
        }
        let (x, to) = (part(self.x, rows, d), part_mut(by_x, rows, d));
        rms_norm_back(&mut change, x, self.gamma, inverses, by_gamma, to);
    }
}

/// Elements from row to row of a block: whole vectors.
fn stride(block: &Range<usize>) -> usize {
    block.len().next_multiple_of(LANES)
}

// Cross-entropy from blocks of logits, without a tensor of log-probabilities.

/// The running softmax of a row.
#[derive(Clone, Copy, Debug)]
struct LogSum {
    /// The largest logit so far.
    largest: f32,
    /// Σ e^(logit − largest).
    sum: f64,
    /// The logit of the target, once seen.
    target: f32,
    /// The first column of the largest logit, if it is looked for.
    likeliest: u32,
}

impl Default for LogSum {
    fn default() -> Self {
        Self { largest: f32::MIN, sum: 0.0, target: f32::NAN, likeliest: 0 }
    }
}

impl LogSum {
    /// ln Σ e^logit.
    fn normaliser(&self) -> f64 {
        f64::from(self.largest) + self.sum.ln()
    }

    /// −ln p of the target, in nats.
    fn loss(&self) -> f64 {
        self.normaliser() - f64::from(self.target)
    }

    /// Takes the next logits of the row; whether one of them is the largest so far.
    #[inline(always)]
    fn add<L: Lanes>(&mut self, logits: &[f32]) -> bool {
        let largest = max::<L>(logits);
        let is_larger = largest > self.largest;
        if is_larger {
            self.sum *= (f64::from(self.largest) - f64::from(largest)).exp();
            self.largest = largest;
        }
        self.sum += f64::from(sum_of_exp::<L>(logits, self.largest));
        is_larger
    }
}

vectorised! {
    /// Adds a block of columns, of as many rows as there are sums, with or without padding; looks for the place of the
    /// largest logit if `find` asks for it.
    fn add_block(
        logits: &[f32],
        columns: Range<usize>,
        targets: &[u32],
        sums: &mut [LogSum],
        find: bool,
    ) {
        let stride = logits.len() / targets.len();
        let rows = logits.chunks_exact(stride).zip(targets).zip(sums);
        for ((row, &target), sum) in rows {
            let row = &row[..columns.len()];
            if sum.add::<L>(row) && find {
                let at = row.iter().position(|&logit| logit == sum.largest).expect("it was met");
                sum.likeliest = (columns.start + at) as u32;
            }
            let within = (target as usize).checked_sub(columns.start);
            if let Some(&logit) = within.and_then(|i| row.get(i)) {
                sum.target = logit;
            }
        }
    }
}

vectorised! {
    /// Turns such a block into the gradient by it of `scale` times the sum of the rows' losses.
    fn gradient_block(
        logits: &mut [f32],
        columns: Range<usize>,
        targets: &[u32],
        sums: &[LogSum],
        scale: f32,
    ) {
        let stride = logits.len() / targets.len();
        let rows = logits.chunks_exact_mut(stride).zip(targets).zip(sums);
        for ((row, &target), sum) in rows {
            let row = &mut row[..columns.len()];
            let normaliser = L::splat(sum.normaliser() as f32);
            for x in row.chunks_mut(LANES) {
                prefetch(x.as_ptr().wrapping_add(AHEAD));
                exp_below_88(L::read(x).sub(normaliser)).mul(L::splat(scale)).write(x);
            }
            let within = (target as usize).checked_sub(columns.start);
            if let Some(x) = within.and_then(|i| row.get_mut(i)) {
                *x -= scale;
            }
        }
    }
}
