//! The passes over one head, one tile of queries at a time: scores, softmax, weighted values, and the backward pass.
//!
//! The backward pass recomputes weights from the scores, to the same bits: that is faster than writing them to memory
//! and reading them again, and needs no memory. Softmax goes pass by pass over all rows of a tile, so that no row waits
//! for another's sum.

use super::heads::{HeadRows, Sight, rotate, rotate_back};
use crate::ops::own::lanes::{LANES, Lanes};
use crate::ops::own::rows::{dot, exp_below_88, max};
use crate::ops::own::small_matrices::{ROWS, Scratch, Span, block, product, tile_rows};

/// Matrices of one head, kept from head to head for their allocations.
#[derive(Default)]
pub struct Workspace {
    /// Rotated and scaled, `[queries, head_dim]`.
    pub queries: Scratch,
    /// Rotated, `[keys, head_dim]`.
    pub keys: Scratch,
    /// The same transposed.
    pub keys_across: Scratch,
    /// `[keys, head_dim]`.
    pub values: Scratch,
    /// The same transposed.
    values_across: Scratch,
    /// Softmax of the scores, of one tile on the way forward, `[queries, keys]` on the way back; each
    /// row to the end of the vector it is cut in.
    weights: Scratch,
    /// Gradient by the weights, then by the scores, `[queries, keys]`.
    grad_scores: Scratch,
    /// The output of one tile on the way forward, the gradient by it `[queries, head_dim]` back.
    output: Scratch,
    /// Gradients by the rotated queries of one tile, and by keys and values, `[keys, head_dim]`.
    pub grad_queries: Scratch,
    pub grad_keys: Scratch,
    pub grad_values: Scratch,
}

impl Workspace {
    /// The scores of the tile that starts at row `first`, into the rows of `weights` from `to` on.
    #[inline(always)]
    fn scores<L: Lanes>(&mut self, sight: &impl Sight, first: usize, to: usize) {
        let span = Span { inner: 0..sight.head_dim(), columns: sight.visible_in_tile::<L>(first) };
        let queries = self.queries.plain().skip_rows(first);
        block::<L, _>(&mut self.weights, to, queries, &self.keys_across, span);
    }
}

/// softmax(queries keysᵀ) values of the head that was read, tile after tile, into its rows.
#[inline(always)]
pub fn mix<L: Lanes>(
    work: &mut Workspace,
    sight: &impl Sight,
    (output, place): (&mut [f32], HeadRows),
    keep: bool,
    room: &mut &mut [f32],
) {
    work.weights.resize::<L>(ROWS, sight.n_keys());
    work.output.resize::<L>(ROWS, sight.head_dim());
    for first in (0..sight.n_queries()).step_by(tile_rows::<L>()) {
        let statistics = attend::<L>(work, sight, first);
        if keep {
            statistics.keep(sight.rows::<L>(first).len(), room);
        }
        let to = (&mut *output, place);
        rotate_back::<L>(to, &work.output, sight.rows::<L>(first), None, 1.0);
    }
}

/// weights = softmax(queries keysᵀ), output = weights values, for the rows of one tile.
#[inline(always)]
fn attend<L: Lanes>(work: &mut Workspace, sight: &impl Sight, first: usize) -> Statistics {
    let visible = sight.visible_in_tile::<L>(first);
    work.scores::<L>(sight, first, 0);
    let tile = Tile { first: 0, visible: sight.visible_by_row::<L>(first) };
    let statistics = softmax::<L>(&mut work.weights, tile);
    let span = Span { inner: 0..visible, columns: sight.head_dim() };
    block::<L, _>(&mut work.output, 0, work.weights.plain(), &work.values, span);
    statistics
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
    work.output.resize::<L>(queries, head_dim);
    rotate::<L>(&mut work.output, gradient, 0..queries, None, 1.0);
    work.weights.resize::<L>(queries, keys);
    work.grad_scores.resize::<L>(queries, keys);
    work.grad_queries.resize::<L>(ROWS, head_dim);
}

/// Weights, gradient by the scores and gradient by the queries of one tile's rows.
#[inline(always)]
pub fn differentiate<L: Lanes>(
    work: &mut Workspace,
    sight: &impl Sight,
    first: usize,
    kept: &mut &[f32],
) {
    let (visible, head_dim) = (sight.visible_in_tile::<L>(first), sight.head_dim());
    let tile = Tile { first, visible: sight.visible_by_row::<L>(first) };
    work.scores::<L>(sight, first, first);
    let statistics = Statistics::take(sight.rows::<L>(first).len(), kept);
    softmax_again::<L>(&mut work.weights, tile, statistics);
    let by_weight = Span { inner: 0..head_dim, columns: visible };
    let output = work.output.plain().skip_rows(first);
    block::<L, _>(&mut work.grad_scores, first, output, &work.values_across, by_weight);
    softmax_back::<L>(&mut work.grad_scores, &work.weights, tile);
    let by_query = Span { inner: 0..visible, columns: head_dim };
    let scores = work.grad_scores.plain().skip_rows(first);
    block::<L, _>(&mut work.grad_queries, 0, scores, &work.keys, by_query);
}

/// Gradients of one head by its turned keys and by its values.
#[inline(always)]
pub fn sum_by_keys_and_values<L: Lanes>(work: &mut Workspace, sight: &impl Sight) {
    let (queries, keys, head_dim) = (sight.n_queries(), sight.n_keys(), sight.head_dim());
    work.grad_keys.resize::<L>(keys, head_dim);
    work.grad_values.resize::<L>(keys, head_dim);
    let viewers = |first| Span { inner: sight.first_viewer(first)..queries, columns: head_dim };
    let (weights, scores) = (work.weights.transposed(), work.grad_scores.transposed());
    product::<L, _>(&mut work.grad_values, keys, weights, &work.output, viewers);
    product::<L, _>(&mut work.grad_keys, keys, scores, &work.queries, viewers);
}

// Softmax over the rows of one tile.

/// The rows of a tile within a matrix of scores, and how many positions each of them sees.
#[derive(Clone, Copy)]
struct Tile {
    /// Its first row.
    first: usize,
    /// Ascending; the last is the tile's extent.
    visible: [usize; ROWS],
}

/// The statistics of a tile's rows: weight = e^(score − largest) · inverse.
#[derive(Clone, Copy)]
pub struct Statistics {
    largest: [f32; ROWS],
    inverse: [f32; ROWS],
}

impl Statistics {
    /// Numbers that are kept for each row.
    pub const PER_ROW: usize = 2;

    /// Writes those of the first `rows` rows to the front of `room`, which advances.
    #[inline(always)]
    fn keep(self, rows: usize, room: &mut &mut [f32]) {
        for values in [self.largest, self.inverse] {
            let (kept, rest) = std::mem::take(room).split_at_mut(rows);
            kept.copy_from_slice(&values[..rows]);
            *room = rest;
        }
    }

    /// Reads those of the first `rows` rows from the front of `kept`; other rows get zeros.
    #[inline(always)]
    fn take(rows: usize, kept: &mut &[f32]) -> Self {
        let [mut largest, mut inverse] = [[0.0; ROWS]; 2];
        for values in [&mut largest, &mut inverse] {
            let (from, rest) = kept.split_at(rows);
            values[..rows].copy_from_slice(from);
            *kept = rest;
        }
        Self { largest, inverse }
    }
}

impl Tile {
    /// Zeros from the vector of a row's cut to that of the end of the tile of keys that the tile's last cut lies in.
    #[inline(always)]
    fn clear_rest<L: Lanes>(self, matrix: &mut Scratch) {
        let end = self.visible[ROWS - 1].next_multiple_of(tile_rows::<L>()).next_multiple_of(LANES);
        for (row, visible) in matrix.rows_mut(self.first).zip(self.visible).take(tile_rows::<L>()) {
            row[visible.next_multiple_of(LANES)..end].fill(0.0);
        }
    }

    /// The tile's rows of `matrix`, cut to whole vectors, and how many positions each sees.
    #[inline(always)]
    fn rows<L: Lanes>(
        self,
        matrix: &mut Scratch,
    ) -> impl Iterator<Item = (&mut [[f32; LANES]], usize)> {
        let rows = matrix.rows_mut(self.first).zip(self.visible).take(tile_rows::<L>());
        rows.map(|(row, visible)| {
            (row[..visible.next_multiple_of(LANES)].as_chunks_mut().0, visible)
        })
    }
}

/// Turns scores into weights, with zeros to the end of their last vector.
#[inline(always)]
fn softmax<L: Lanes>(scores: &mut Scratch, tile: Tile) -> Statistics {
    let [mut largest, mut inverse] = [[0.0; ROWS]; 2];
    for ((row, visible), largest) in tile.rows::<L>(scores).zip(&mut largest) {
        *largest = max::<L>(&row.as_flattened()[..visible]);
    }
    for (((row, visible), largest), inverse) in
        tile.rows::<L>(scores).zip(largest).zip(&mut inverse)
    {
        *inverse = 1.0 / powers::<L>(row, visible, largest, 1.0);
    }
    for ((row, _), inverse) in tile.rows::<L>(scores).zip(inverse) {
        for x in row {
            L::load(x).mul(L::splat(inverse)).store(x);
        }
    }
    tile.clear_rest::<L>(scores);
    Statistics { largest, inverse }
}

/// Like [`softmax`], to the same bits, with known statistics.
#[inline(always)]
fn softmax_again<L: Lanes>(scores: &mut Scratch, tile: Tile, statistics: Statistics) {
    let Statistics { largest, inverse } = statistics;
    for (((row, visible), largest), inverse) in tile.rows::<L>(scores).zip(largest).zip(inverse) {
        powers::<L>(row, visible, largest, inverse);
    }
    tile.clear_rest::<L>(scores);
}

/// Replaces the first `visible` scores of a row by factor · e^(score − largest), the rest by zeros; returns the sum of
/// the powers.
#[inline(always)]
fn powers<L: Lanes>(row: &mut [[f32; LANES]], visible: usize, largest: f32, factor: f32) -> f32 {
    let (largest, factor) = (L::splat(largest), L::splat(factor));
    let mut sum = L::splat(0.0);
    let Some((last, whole)) = row.split_last_mut() else { return 0.0 };
    let left = visible - whole.len() * LANES;
    for x in whole {
        let power = exp_below_88(L::load(x).sub(largest));
        sum = sum.add(power);
        power.mul(factor).store(x);
    }
    let power = exp_below_88(L::load(last).sub(largest)).first(left, L::splat(0.0));
    power.mul(factor).store(last);
    sum.add(power).sum()
}

/// Turns gradients by weights into gradients by scores: wᵢ (gᵢ − Σⱼ wⱼ gⱼ).
#[inline(always)]
fn softmax_back<L: Lanes>(gradient: &mut Scratch, weights: &Scratch, tile: Tile) {
    let mut means = [0.0; ROWS];
    // Counted, since the compiler leaves the steps of a longer `zip` as calls.
    for (r, (row, visible)) in tile.rows::<L>(gradient).enumerate() {
        means[r] = dot::<L>(&row.as_flattened()[..visible], weights.row(tile.first + r));
    }
    for (r, (row, visible)) in tile.rows::<L>(gradient).enumerate() {
        let Some((last, whole)) = row.split_last_mut() else { return };
        let (left, mean) = (visible - whole.len() * LANES, L::splat(means[r]));
        let weights = &weights.row(tile.first + r).as_chunks().0[..=whole.len()];
        for (x, weight) in whole.iter_mut().zip(weights) {
            L::load(x).sub(mean).mul(L::load(weight)).store(x);
        }
        let by_score = L::load(last).sub(mean).mul(L::load(&weights[whole.len()]));
        by_score.first(left, L::splat(0.0)).store(last);
    }
    tile.clear_rest::<L>(gradient);
}
