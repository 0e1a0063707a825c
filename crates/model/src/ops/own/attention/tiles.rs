//! The passes over one head, one tile of queries at a time: scores, softmax, weighted values, and the backward pass.
//!
//! The backward pass recomputes weights from the scores, to the same bits: that is faster than writing them to memory
//! and reading them again, and needs no memory. Softmax goes pass by pass over all rows of a tile, so that no row waits
//! for another's sum.

use super::heads::{HeadRows, Sight, rotate, rotate_back};
use crate::ops::own::lanes::{LANES, Lanes};
use crate::ops::own::rows::exp_below_88;
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
    /// The scores of the tile of queries that starts at row `first`, into its rows of `weights`.
    #[inline(always)]
    fn scores<L: Lanes>(&mut self, head_dim: usize, first: usize, tile: Tile) {
        let span = Span { inner: 0..head_dim, columns: tile.extent };
        let queries = self.queries.plain().skip_rows(first);
        block::<L, _>(&mut self.weights, tile.first, queries, &self.keys_across, span);
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
    let tile = Tile::new::<L>(0, sight.visible_by_row::<L>(first));
    work.scores::<L>(sight.head_dim(), first, tile);
    let statistics = softmax::<L>(&mut work.weights, tile);
    let span = Span { inner: 0..tile.extent, columns: sight.head_dim() };
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
    let head_dim = sight.head_dim();
    let tile = Tile::new::<L>(first, sight.visible_by_row::<L>(first));
    work.scores::<L>(head_dim, first, tile);
    let statistics = Statistics::take(sight.rows::<L>(first).len(), kept);
    softmax_again::<L>(&mut work.weights, tile, statistics);
    let by_weight = Span { inner: 0..head_dim, columns: tile.extent };
    let output = work.output.plain().skip_rows(first);
    block::<L, _>(&mut work.grad_scores, first, output, &work.values_across, by_weight);
    softmax_back::<L>(&mut work.grad_scores, &mut work.weights, tile);
    let by_query = Span { inner: 0..tile.extent, columns: head_dim };
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
    /// Ascending.
    visible: [usize; ROWS],
    /// Those that its last row sees.
    extent: usize,
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
    #[inline(always)]
    fn new<L: Lanes>(first: usize, visible: [usize; ROWS]) -> Self {
        Self { first, visible, extent: visible[tile_rows::<L>() - 1] }
    }

    /// The first row of `matrix`, which must have room for the tile, and the elements from row to row.
    #[inline(always)]
    fn memory<L: Lanes>(self, matrix: &mut Scratch) -> (*mut f32, usize) {
        assert!(self.extent > 0, "a tile of attention sees nothing");
        matrix.memory_mut(self.first + tile_rows::<L>(), self.end::<L>())
    }

    /// Its row `r`, of what [`Tile::memory`] gives.
    #[inline(always)]
    fn row(self, (memory, stride): (*mut f32, usize), r: usize) -> Row {
        let visible = self.visible[r].min(self.extent);
        let whole = visible.saturating_sub(1) / LANES;
        let first = memory.wrapping_add((self.first + r) * stride);
        Row { first, whole, left: visible - whole * LANES }
    }

    /// The end of the tile of keys that its last cut lies in.
    #[inline(always)]
    fn end<L: Lanes>(self) -> usize {
        self.extent.next_multiple_of(tile_rows::<L>())
    }

    /// Zeros from the vector of a row's cut to that of [`Tile::end`].
    #[inline(always)]
    fn clear_rest<L: Lanes>(self, memory: (*mut f32, usize)) {
        let end = self.end::<L>().div_ceil(LANES);
        // Mostly all rows are cut in its last vector.
        if self.visible[0].div_ceil(LANES) >= end {
            return;
        }
        for r in 0..tile_rows::<L>() {
            let row = self.row(memory, r);
            for v in row.whole + 1..end {
                row.store(v, L::splat(0.0));
            }
        }
    }
}

/// A row of a tile: whole vectors that it sees, and one more of which it sees the first elements.
///
/// It is a pointer: the compiler repeats the bounds checks of slices after every store, and they take as long as a short row.
#[derive(Clone, Copy)]
struct Row {
    first: *mut f32,
    whole: usize,
    /// Elements of the last vector.
    left: usize,
}

impl Row {
    #[inline(always)]
    fn load<L: Lanes>(self, v: usize) -> L {
        // SAFETY: `Tile::memory` has checked that the row has the vectors up to `Tile::end`; no `v` lies after them.
        L::load(unsafe { &*self.first.add(v * LANES).cast() })
    }

    #[inline(always)]
    fn store<L: Lanes>(self, v: usize, vector: L) {
        // SAFETY: as in `load`.
        vector.store(unsafe { &mut *self.first.add(v * LANES).cast() });
    }

    /// The last vector, with `rest` for what the row does not see.
    #[inline(always)]
    fn cut<L: Lanes>(self, last: L, rest: f32) -> L {
        last.first(self.left, L::splat(rest))
    }
}

/// Turns scores into weights, with zeros to the end of their last vector.
#[inline(always)]
fn softmax<L: Lanes>(scores: &mut Scratch, tile: Tile) -> Statistics {
    let [mut largest, mut inverse] = [[0.0; ROWS]; 2];
    let memory = tile.memory::<L>(scores);
    for (r, largest) in largest.iter_mut().enumerate().take(tile_rows::<L>()) {
        let row = tile.row(memory, r);
        let mut vector = row.cut(row.load::<L>(row.whole), f32::MIN);
        for v in 0..row.whole {
            vector = row.load::<L>(v).max(vector);
        }
        *largest = vector.largest();
    }
    for r in 0..tile_rows::<L>() {
        inverse[r] = 1.0 / powers::<L>(tile.row(memory, r), largest[r], 1.0);
    }
    for r in 0..tile_rows::<L>() {
        let (row, inverse) = (tile.row(memory, r), L::splat(inverse[r]));
        for v in 0..=row.whole {
            row.store(v, row.load::<L>(v).mul(inverse));
        }
    }
    tile.clear_rest::<L>(memory);
    Statistics { largest, inverse }
}

/// Like [`softmax`], to the same bits, with known statistics.
#[inline(always)]
fn softmax_again<L: Lanes>(scores: &mut Scratch, tile: Tile, statistics: Statistics) {
    let Statistics { largest, inverse } = statistics;
    let memory = tile.memory::<L>(scores);
    for r in 0..tile_rows::<L>() {
        powers::<L>(tile.row(memory, r), largest[r], inverse[r]);
    }
    tile.clear_rest::<L>(memory);
}

/// Replaces the scores of a row by factor · e^(score − largest), with zeros to the end of the last vector; returns the sum
/// of the powers.
#[inline(always)]
fn powers<L: Lanes>(row: Row, largest: f32, factor: f32) -> f32 {
    let (largest, factor) = (L::splat(largest), L::splat(factor));
    let mut sum = L::splat(0.0);
    for v in 0..row.whole {
        let power = exp_below_88(row.load::<L>(v).sub(largest));
        sum = sum.add(power);
        row.store(v, power.mul(factor));
    }
    let power = row.cut(exp_below_88(row.load::<L>(row.whole).sub(largest)), 0.0);
    row.store(row.whole, power.mul(factor));
    sum.add(power).sum()
}

/// Turns gradients by weights into gradients by scores: wᵢ (gᵢ − Σⱼ wⱼ gⱼ).
#[inline(always)]
fn softmax_back<L: Lanes>(gradient: &mut Scratch, weights: &mut Scratch, tile: Tile) {
    let mut means = [0.0; ROWS];
    let (memory, weights) = (tile.memory::<L>(gradient), tile.memory::<L>(weights));
    for (r, mean) in means.iter_mut().enumerate().take(tile_rows::<L>()) {
        let (row, weights) = (tile.row(memory, r), tile.row(weights, r));
        let mut sum = L::splat(0.0);
        for v in 0..row.whole {
            sum = row.load::<L>(v).mul_add(weights.load(v), sum);
        }
        let last = row.cut(row.load::<L>(row.whole), 0.0);
        *mean = last.mul_add(weights.load(row.whole), sum).sum();
    }
    for (r, mean) in means.into_iter().enumerate().take(tile_rows::<L>()) {
        let (row, weights) = (tile.row(memory, r), tile.row(weights, r));
        let mean = L::splat(mean);
        for v in 0..row.whole {
            row.store(v, row.load::<L>(v).sub(mean).mul(weights.load(v)));
        }
        let by_score = row.load::<L>(row.whole).sub(mean).mul(weights.load(row.whole));
        row.store(row.whole, row.cut(by_score, 0.0));
    }
    tile.clear_rest::<L>(memory);
}
