//! Products of matrices of a few dozen rows, for one head of one sequence at a time.
//!
//! A general product packs its operands first, which at these sizes costs as much as the product
//! itself, and cannot leave out what the mask rules out. This one computes tiles of [`ROWS`] rows
//! and one or two vectors of columns in registers, straight from scratch matrices whose rows are
//! padded to whole vectors.

use std::ops::Range;

use super::lanes::{LANES, Lanes};
use super::left::Left;
use super::scratch::{ROWS, Scratch};

/// Rows of a tile where registers are few.
const HALF: usize = ROWS / 2;

/// What a block of [`ROWS`] rows of a product takes: part of the inner dimension, and how many
/// columns of the result are wanted.
pub struct Span {
    pub inner: Range<usize>,
    pub columns: usize,
}

/// `out = left right` for the first `rows` rows, each block of rows within its span.
///
/// Columns are computed to the end of a vector, and rows to the end of a tile.
#[inline(always)]
pub fn product<L: Lanes, const TRANSPOSED: bool>(
    out: &mut Scratch,
    rows: usize,
    left: Left<'_, TRANSPOSED>,
    right: &Scratch,
    span: impl Fn(usize) -> Span,
) {
    for first in (0..rows).step_by(ROWS) {
        block::<L, _>(out, first, left.skip_rows(first), right, span(first));
    }
}

/// The block of [`ROWS`] rows of `out` that starts at `row`: the first ones of `left`, times
/// `right`.
#[inline(always)]
pub fn block<L: Lanes, const TRANSPOSED: bool>(
    out: &mut Scratch,
    row: usize,
    left: Left<'_, TRANSPOSED>,
    right: &Scratch,
    span: Span,
) {
    let Span { inner, columns } = span;
    left.check(ROWS, inner.end);
    right.check(inner.end, columns);
    let mut column = 0;
    while L::MANY && column + LANES < columns {
        tile::<L, ROWS, 2, _>(out, (row, column), left, right, inner.clone());
        column += 2 * LANES;
    }
    while column < columns {
        if L::MANY {
            tile::<L, ROWS, 1, _>(out, (row, column), left, right, inner.clone());
        } else {
            let rest = left.skip_rows(HALF);
            tile::<L, HALF, 1, _>(out, (row, column), left, right, inner.clone());
            tile::<L, HALF, 1, _>(out, (row + HALF, column), rest, right, inner.clone());
        }
        column += LANES;
    }
}

/// One tile of the result at `(row, column)`, of the first `R` rows of `left` and `V` vectors.
#[inline(always)]
fn tile<L: Lanes, const R: usize, const V: usize, const TRANSPOSED: bool>(
    out: &mut Scratch,
    (row, column): (usize, usize),
    left: Left<'_, TRANSPOSED>,
    right: &Scratch,
    inner: Range<usize>,
) {
    let mut sums = [[L::splat(0.0); V]; R];
    for k in inner {
        let mut vectors = [L::splat(0.0); V];
        for (v, vector) in vectors.iter_mut().enumerate() {
            // SAFETY: `block` has checked.
            *vector = unsafe { right.vector(k, column + v * LANES) };
        }
        for (r, sums) in sums.iter_mut().enumerate() {
            // SAFETY: `block` has checked.
            let left = L::splat(unsafe { left.at(r, k) });
            for (sum, right) in sums.iter_mut().zip(vectors) {
                *sum = left.mul_add(right, *sum);
            }
        }
    }
    for (row, sums) in out.rows_mut(row).zip(sums) {
        let row = &mut row[column..column + V * LANES];
        for (v, sum) in sums.into_iter().enumerate() {
            sum.write(&mut row[v * LANES..(v + 1) * LANES]);
        }
    }
}
