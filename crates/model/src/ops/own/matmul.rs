//! Products of large matrices: the linear layers, the head, and their gradients.
//!
//! The right operand is copied into [`Panels`] first, so that what a tile reads of it lies in one
//! piece; the left operand is read where it lies, or from a copy in tiles. A [`Tile`] stays in registers
//! for up to [`DEPTH`] multiply-adds an element. Every element is summed in the order of the inner
//! dimension, whatever the tile, so the bits are those of every machine that multiplies and adds in one step.

use std::ops::Range;

use super::buffers::Buffer;
use super::lanes::{LANES, Lanes, Tile};
use super::panels::{PANEL, Panels, Part, View};
use super::vectors::vectorised;

/// Inner elements between two visits of the result: a panel of as many stays in the first cache.
const DEPTH: usize = 256;

/// Rows that meet a panel before the next panel comes: they stay in the second cache. Whole tiles of any kind.
const BLOCK: usize = 192;

/// Columns from which on a transposed left operand is copied into tiles where registers are few.
const COPIED: usize = 256;

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

    /// The first `rows` rows and `columns` columns of a tile, its first row and column being given; zeros beyond.
    #[inline(always)]
    fn tile<L: Lanes, const R: usize, const V: usize>(
        &mut self,
        (i, j): (usize, usize),
        (rows, columns): (usize, usize),
    ) -> [[L; V]; R] {
        let mut tile = [[L::splat(0.0); V]; R];
        for (r, tile) in tile.iter_mut().enumerate() {
            for (v, lanes) in tile.iter_mut().enumerate() {
                if r < rows && v * LANES < columns {
                    *lanes = L::read(self.lanes(i + r, j + v * LANES, columns - v * LANES));
                }
            }
        }
        tile
    }

    /// Writes as much of a tile.
    #[inline(always)]
    fn set_tile<L: Lanes, const R: usize, const V: usize>(
        &mut self,
        (i, j): (usize, usize),
        (rows, columns): (usize, usize),
        tile: &[[L; V]; R],
    ) {
        for (r, tile) in tile.iter().enumerate() {
            for (v, lanes) in tile.iter().enumerate() {
                if r < rows && v * LANES < columns {
                    lanes.write(self.lanes(i + r, j + v * LANES, columns - v * LANES));
                }
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
        let of = (&mut target, rows, left, right);
        match L::TILE {
            Tile::EightByTwo => tiles::<L, 8, 2>(of, columns, inner, add),
            Tile::SixByOne => tiles::<L, 6, 1>(of, columns, inner, add),
            Tile::FourByOne => tiles::<L, 4, 1>(of, columns, inner, add),
        }
    }
}

/// A product by tiles of `R` rows and `V` vectors.
#[inline(always)]
fn tiles<L: Lanes, const R: usize, const V: usize>(
    (target, rows, left, right): (&mut Target<'_>, usize, View<'_>, &Panels),
    columns: Range<usize>,
    inner: Range<usize>,
    add: bool,
) {
    let copies = V == 1 && left.is_transposed() && columns.len() >= COPIED;
    let mut copy = if copies { Buffer::new(BLOCK * DEPTH) } else { Buffer::default() };
    for block in (0..rows).step_by(BLOCK) {
        let block = block..rows.min(block + BLOCK);
        for first in inner.clone().step_by(DEPTH) {
            let depth = first..inner.end.min(first + DEPTH);
            let (add, left) = (add || first > inner.start, left.skip_columns(first - inner.start));
            if copies {
                left.copy_tiles::<R>(block.clone(), depth.len(), &mut copy);
            }
            for column in columns.clone().step_by(PANEL) {
                let mut panel = right.part(column, depth.clone());
                panel.columns = panel.columns.min(columns.end - column);
                for row in block.clone().step_by(R) {
                    let count = R.min(block.end - row);
                    let at = (row, column - columns.start);
                    if copies {
                        let copy = &copy[(row - block.start) * depth.len()..];
                        tile::<L, R, V>(
                            target,
                            at,
                            count,
                            View::new(copy, R).transposed(),
                            panel,
                            add,
                        );
                    } else if panel.is_narrow() {
                        tile::<L, R, 1>(target, at, count, left.skip_rows(row), panel, add);
                    } else {
                        tile::<L, R, V>(target, at, count, left.skip_rows(row), panel, add);
                    }
                }
            }
        }
    }
}

// One tile of a product, in registers.

/// The first `count` of `R` rows at `(row, column)`, against `V` vectors of a panel at a time.
///
/// `left` starts at the first of them and at the first inner element, and has been checked; rows after the last are
/// computed from the last and thrown away.
#[inline(always)]
fn tile<L: Lanes, const R: usize, const V: usize>(
    target: &mut Target<'_>,
    (row, column): (usize, usize),
    count: usize,
    left: View<'_>,
    panel: Part<'_>,
    add: bool,
) {
    let mut rows = [0; R];
    for (r, row) in rows.iter_mut().enumerate() {
        *row = r.min(count - 1);
    }
    let mut from = 0;
    while from < panel.columns {
        let at = (row, column + from);
        // Both branches do the same. In the first one the compiler knows the sizes and unrolls the loops.
        let whole = (R, V * LANES);
        let size = (count, whole.1.min(panel.columns - from));
        if size == whole {
            let sums = if add { target.tile(at, whole) } else { [[L::splat(0.0); V]; R] };
            let sums = accumulate::<L, R, V>(sums, rows, left, panel, from);
            target.set_tile(at, whole, &sums);
        } else {
            let sums = if add { target.tile(at, size) } else { [[L::splat(0.0); V]; R] };
            let sums = accumulate::<L, R, V>(sums, rows, left, panel, from);
            target.set_tile(at, size, &sums);
        }
        from += V * LANES;
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
