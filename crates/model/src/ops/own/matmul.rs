//! Products of large matrices: the linear layers, the head, and their gradients.
//!
//! The right operand is copied into [`Panels`] first, so that a tile reads contiguous memory; the left operand is read in
//! place. A tile of eight rows by a panel stays in registers for up to [`DEPTH`] multiply-adds per element. Every element
//! is summed in the order of the inner dimension, cut at multiples of [`DEPTH`], for every vector width.

use std::ops::Range;

use super::buffers::Buffer;
use super::lanes::{LANES, Lanes, vectorised};
use super::panels::{PANEL, Panels, Part, View};

/// Rows of a tile.
const ROWS: usize = 8;

/// Rows of a tile where registers are few.
const HALF: usize = ROWS / 2;

/// Inner elements between two visits of the result: a panel of as many stays in the first cache.
const DEPTH: usize = 256;

/// Rows that meet a panel before the next panel comes: they stay in the second cache.
const BLOCK: usize = 192;

/// The result of a product: a matrix of rows `stride` elements apart.
pub struct Target<'a> {
    values: &'a mut [f32],
    stride: usize,
}

impl<'a> Target<'a> {
    /// Rows of `stride` elements, the first ones of which are written.
    pub fn new(values: &'a mut [f32], stride: usize) -> Self {
        Self { values, stride }
    }

    /// The same for one more use.
    fn reborrow(&mut self) -> Target<'_> {
        Target { values: self.values, stride: self.stride }
    }

    /// Sees that so many rows and columns have room.
    fn check(&self, rows: usize, columns: usize) {
        let end = (rows.max(1) - 1) * self.stride + columns;
        assert!(end <= self.values.len(), "a result of {rows} x {columns} has no room");
    }

    /// A whole tile, its first row and column being given.
    #[inline(always)]
    fn whole<L: Lanes, const R: usize, const V: usize>(&self, i: usize, j: usize) -> [[L; V]; R] {
        std::array::from_fn(|r| {
            let row = &self.values[(i + r) * self.stride + j..][..V * LANES];
            std::array::from_fn(|v| L::read(&row[v * LANES..][..LANES]))
        })
    }

    /// Writes a whole tile.
    #[inline(always)]
    fn set_whole<L: Lanes, const R: usize, const V: usize>(
        &mut self,
        i: usize,
        j: usize,
        tile: [[L; V]; R],
    ) {
        for (r, lanes) in tile.into_iter().enumerate() {
            let row = &mut self.values[(i + r) * self.stride + j..][..V * LANES];
            for (v, lanes) in lanes.into_iter().enumerate() {
                lanes.write(&mut row[v * LANES..][..LANES]);
            }
        }
    }

    /// Up to a vector of row `i` from column `j` on, of which `columns` are left.
    #[inline(always)]
    fn lanes(&mut self, i: usize, j: usize, columns: usize) -> &mut [f32] {
        &mut self.values[i * self.stride + j..][..columns.min(LANES)]
    }
}

/// `target = left right`, or `target += left right` where `add` says so, for `rows` rows.
pub fn multiply(target: Target<'_>, rows: usize, left: View<'_>, right: &Panels, add: bool) {
    multiply_part(target, rows, left, right, 0..right.columns(), 0..right.inner(), add);
}

/// As [`multiply`], by the columns and inner rows of `right` alone that are given; `left` and
/// `target` start at the first of them, and panels must start with the first column.
pub fn multiply_part(
    target: Target<'_>,
    rows: usize,
    left: View<'_>,
    right: &Panels,
    columns: Range<usize>,
    inner: Range<usize>,
    add: bool,
) {
    assert!(columns.start.is_multiple_of(PANEL), "column {} starts no panel", columns.start);
    left.check(rows, inner.len());
    target.check(rows, columns.len());
    blocks(target, rows, left, right, columns, inner, add);
}

/// `target += leftᵀ right` over `inner` rows of both; `panels` is room to work in.
///
/// `left` has as many columns as `target` has rows.
pub fn add_transposed(
    mut target: Target<'_>,
    (rows, columns): (usize, usize),
    left: View<'_>,
    right: View<'_>,
    inner: usize,
    panels: &mut Panels,
) {
    for first in (0..inner).step_by(DEPTH) {
        let depth = DEPTH.min(inner - first);
        panels.pack(right.skip_rows(first), depth, columns);
        let left = left.skip_rows(first).transposed();
        multiply(target.reborrow(), rows, left, panels, true);
    }
}

/// The columns of `matrix`, `columns` of them, as rows.
pub fn transposed(matrix: &[f32], columns: usize) -> Buffer {
    let rows = matrix.len() / columns;
    let mut output = Buffer::new(matrix.len());
    for first in (0..rows).step_by(LANES) {
        for (j, column) in output.chunks_exact_mut(rows).enumerate() {
            for (i, to) in (first..rows).zip(&mut column[first..rows.min(first + LANES)]) {
                *to = matrix[i * columns + j];
            }
        }
    }
    output
}

vectorised! {
    fn blocks(
        target: Target<'_>,
        rows: usize,
        left: View<'_>,
        right: &Panels,
        columns: Range<usize>,
        inner: Range<usize>,
        add: bool,
    ) {
        let mut target = target;
        for block in (0..rows).step_by(BLOCK) {
            let block = block..rows.min(block + BLOCK);
            for first in inner.clone().step_by(DEPTH) {
                let depth = first..inner.end.min(first + DEPTH);
                let (add, left) = (add || first > inner.start, left.skip_columns(first - inner.start));
                for column in columns.clone().step_by(PANEL) {
                    let mut panel = right.part(column, depth.clone());
                    panel.columns = panel.columns.min(columns.end - column);
                    strip::<L>(&mut target, block.clone(), column - columns.start, left, panel, add);
                }
            }
        }
    }
}

/// The rows of a block against one panel.
#[inline(always)]
fn strip<L: Lanes>(
    target: &mut Target<'_>,
    rows: Range<usize>,
    column: usize,
    left: View<'_>,
    panel: Part<'_>,
    add: bool,
) {
    for row in rows.clone().step_by(ROWS) {
        let count = ROWS.min(rows.end - row);
        let at = (row, column);
        if !L::MANY {
            tile::<L, HALF, 1>(target, at, count, left, panel, add);
            if count > HALF {
                tile::<L, HALF, 1>(target, (row + HALF, column), count - HALF, left, panel, add);
            }
        } else if panel.is_narrow() {
            tile::<L, ROWS, 1>(target, at, count, left, panel, add);
        } else {
            tile::<L, ROWS, 2>(target, at, count, left, panel, add);
        }
    }
}

// One tile of a product, in registers.

/// The first `count` of `R` rows at `(row, column)`, against `V` vectors of a panel at a time.
///
/// `left` starts at the first inner element and has been checked; rows after the last are computed
/// from the last and thrown away.
#[inline(always)]
fn tile<L: Lanes, const R: usize, const V: usize>(
    target: &mut Target<'_>,
    (row, column): (usize, usize),
    count: usize,
    left: View<'_>,
    panel: Part<'_>,
    add: bool,
) {
    let rows: [usize; R] = std::array::from_fn(|r| row + r.min(count.min(R) - 1));
    let mut from = 0;
    while from < panel.columns {
        let columns = panel.columns - from;
        let at = column + from;
        if count >= R && columns >= V * LANES {
            let sums = if add { target.whole::<L, R, V>(row, at) } else { zeros() };
            let sums = accumulate::<L, R, V>(sums, rows, left, panel, from);
            target.set_whole(row, at, sums);
        } else {
            let mut sums = zeros();
            if add {
                for_each::<R, V>(count, columns, |r, v, columns| {
                    sums[r][v] = L::read(target.lanes(rows[r], at + v * LANES, columns));
                });
            }
            let sums = accumulate::<L, R, V>(sums, rows, left, panel, from);
            for_each::<R, V>(count, columns, |r, v, columns| {
                sums[r][v].write(target.lanes(rows[r], at + v * LANES, columns));
            });
        }
        from += V * LANES;
    }
}

#[inline(always)]
fn zeros<L: Lanes, const R: usize, const V: usize>() -> [[L; V]; R] {
    [[L::splat(0.0); V]; R]
}

/// Calls `with` for each row and vector that is wanted, with the columns left from there.
#[inline(always)]
fn for_each<const R: usize, const V: usize>(
    count: usize,
    columns: usize,
    mut with: impl FnMut(usize, usize, usize),
) {
    for r in 0..R {
        for v in 0..V {
            if r < count && v * LANES < columns {
                with(r, v, columns - v * LANES);
            }
        }
    }
}

/// Adds the products of a tile to `sums`, from column `from` of the panel on.
#[inline(always)]
fn accumulate<L: Lanes, const R: usize, const V: usize>(
    mut sums: [[L; V]; R],
    rows: [usize; R],
    left: View<'_>,
    panel: Part<'_>,
    from: usize,
) -> [[L; V]; R] {
    for (k, right) in panel.rows.iter().enumerate() {
        let mut vectors = [L::splat(0.0); V];
        for (v, vector) in vectors.iter_mut().enumerate() {
            *vector = L::read(&right[from + v * LANES..][..LANES]);
        }
        for (sums, row) in sums.iter_mut().zip(rows) {
            // SAFETY: `multiply` has checked all rows and the whole inner dimension.
            let left = L::splat(unsafe { left.at(row, k) });
            for (sum, right) in sums.iter_mut().zip(vectors) {
                *sum = left.mul_add(right, *sum);
            }
        }
    }
    sums
}
