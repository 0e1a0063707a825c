//! Products of large matrices: the linear layers, the head, and their gradients.
//!
//! The right operand is copied into [`Panels`] first, so that what a tile reads of it lies in one
//! piece; the left operand is read where it lies. A tile of eight rows by a panel stays in
//! registers for up to [`DEPTH`] multiply-adds an element. Every element is summed in the order of
//! the inner dimension, cut at multiples of [`DEPTH`], whatever the vectors of the machine are.

mod panels;
mod tile;

pub use panels::{Panels, View};
pub use tile::Target;

use std::ops::Range;

use super::buffers::Buffer;
use super::lanes::{LANES, Lanes, vectorised};
use panels::PANEL;
use tile::tile;

/// Rows of a tile.
const ROWS: usize = 8;

/// Rows of a tile where registers are few.
const HALF: usize = ROWS / 2;

/// Inner elements between two visits of the result: a panel of as many stays in the first cache.
const DEPTH: usize = 256;

/// Rows that meet a panel before the next panel comes: they stay in the second cache.
const BLOCK: usize = 192;

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
    panel: panels::Part<'_>,
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
