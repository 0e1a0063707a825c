//! Products of matrices of a few dozen rows, for one head of one sequence at a time.
//!
//! A general product packs its operands first, which at these sizes costs as much as the product
//! itself, and cannot leave out what the mask rules out. This one computes tiles of [`ROWS`] rows
//! and one or two vectors of columns in registers, straight from scratch matrices whose rows are
//! padded to whole vectors.

use std::ops::Range;

use super::lanes::{LANES, Lanes};

/// Rows of a tile; scratch matrices hold a multiple of these.
pub const ROWS: usize = 8;

/// Rows of a tile where registers are few.
const HALF: usize = ROWS / 2;

/// A row-major matrix padded to whole tiles; what lies in the padding is unspecified.
#[derive(Default)]
pub struct Scratch {
    values: Vec<f32>,
    /// Distance between rows.
    stride: usize,
}

impl Scratch {
    /// Makes room for `rows` x `columns`, keeping the allocation and whatever it holds.
    pub fn resize(&mut self, rows: usize, columns: usize) {
        self.stride = columns.next_multiple_of(LANES);
        let needed = rows.next_multiple_of(ROWS) * self.stride;
        if self.values.len() < needed {
            self.values.resize(needed, 0.0);
        }
    }

    /// Row `i`, its padding included.
    #[inline(always)]
    pub fn row(&self, i: usize) -> &[f32] {
        &self.values[i * self.stride..][..self.stride]
    }

    /// Row `i`, its padding included.
    #[inline(always)]
    pub fn row_mut(&mut self, i: usize) -> &mut [f32] {
        &mut self.values[i * self.stride..][..self.stride]
    }

    /// Writes the first elements of column `j`.
    #[inline(always)]
    pub fn set_column(&mut self, j: usize, column: &[f32]) {
        for (row, &value) in self.values.chunks_exact_mut(self.stride).zip(column) {
            row[j] = value;
        }
    }

    /// The vector that starts at column `j` of row `i`.
    #[inline(always)]
    fn vector<L: Lanes>(&self, i: usize, j: usize) -> L {
        L::read(&self.values[i * self.stride + j..][..LANES])
    }

    /// This matrix as the left operand of [`product`].
    #[inline(always)]
    pub fn plain(&self) -> Left<'_> {
        Left { values: &self.values, row_stride: self.stride, inner_stride: 1 }
    }

    /// The transpose of this matrix as the left operand of [`product`].
    #[inline(always)]
    pub fn transposed(&self) -> Left<'_> {
        Left { values: &self.values, row_stride: 1, inner_stride: self.stride }
    }
}

/// The left operand of a product.
#[derive(Clone, Copy)]
pub struct Left<'a> {
    values: &'a [f32],
    row_stride: usize,
    inner_stride: usize,
}

impl Left<'_> {
    /// Sees that there are so many rows and inner elements, which [`Left::at`] relies on.
    #[inline(always)]
    fn check(&self, rows: usize, inner: usize) {
        let last = (rows.max(1) - 1) * self.row_stride + (inner.max(1) - 1) * self.inner_stride;
        assert!(last < self.values.len(), "a product reads beyond its left operand");
    }

    /// # Safety
    ///
    /// There must be such a row and inner element: see [`Left::check`].
    #[inline(always)]
    unsafe fn at(&self, row: usize, inner: usize) -> f32 {
        // SAFETY: the caller's promise.
        unsafe { *self.values.get_unchecked(row * self.row_stride + inner * self.inner_stride) }
    }
}

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
pub fn product<L: Lanes>(
    out: &mut Scratch,
    rows: usize,
    left: Left<'_>,
    right: &Scratch,
    span: impl Fn(usize) -> Span,
) {
    for first in (0..rows).step_by(ROWS) {
        let Span { inner, columns } = span(first);
        let mut column = 0;
        while L::MANY && column + LANES < columns {
            tile::<L, ROWS, 2>(out, (first, column), left, right, inner.clone());
            column += 2 * LANES;
        }
        while column < columns {
            if L::MANY {
                tile::<L, ROWS, 1>(out, (first, column), left, right, inner.clone());
            } else {
                tile::<L, HALF, 1>(out, (first, column), left, right, inner.clone());
                tile::<L, HALF, 1>(out, (first + HALF, column), left, right, inner.clone());
            }
            column += LANES;
        }
    }
}

/// One tile of the result at `(row, column)`, of `R` rows and `V` vectors.
#[inline(always)]
fn tile<L: Lanes, const R: usize, const V: usize>(
    out: &mut Scratch,
    (row, column): (usize, usize),
    left: Left<'_>,
    right: &Scratch,
    inner: Range<usize>,
) {
    left.check(row + R, inner.end);
    let mut sums = [[L::splat(0.0); V]; R];
    for k in inner {
        let mut vectors = [L::splat(0.0); V];
        for (v, vector) in vectors.iter_mut().enumerate() {
            *vector = right.vector(k, column + v * LANES);
        }
        for (r, sums) in sums.iter_mut().enumerate() {
            // SAFETY: checked above.
            let left = L::splat(unsafe { left.at(row + r, k) });
            for (sum, right) in sums.iter_mut().zip(vectors) {
                *sum = left.mul_add(right, *sum);
            }
        }
    }
    for (r, sums) in sums.into_iter().enumerate() {
        for (v, sum) in sums.into_iter().enumerate() {
            sum.write(&mut out.row_mut(row + r)[column + v * LANES..][..LANES]);
        }
    }
}
