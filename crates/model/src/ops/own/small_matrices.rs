//! [`Scratch`]: matrices of a few dozen rows, and their products, for one head of one sequence at a time.
//!
//! A general product packs its operands first, which at these sizes costs as much as the product itself, and cannot skip
//! masked parts. This one computes tiles of [`tile_rows`] rows and one or two vectors of columns in registers, directly
//! from scratch matrices with rows padded to whole vectors.

use std::ops::Range;

use super::buffers::Buffer;
use super::lanes::{LANES, Lanes, Tile};
use super::panels::transpose_block;

/// Rows of a tile where registers are many: no tile has more.
pub const ROWS: usize = 8;

/// Rows of a tile where registers are few.
const FEW: usize = 6;

/// Rows of a tile. Its sums are enough that none waits for another, and fit in the registers.
pub const fn tile_rows<L: Lanes>() -> usize {
    match L::TILE {
        Tile::SixByFour => ROWS,
        Tile::SixByOne | Tile::FourByOne => FEW,
    }
}

/// A row-major matrix padded to whole tiles; the padding is unspecified.
#[derive(Default)]
pub struct Scratch {
    values: Buffer,
    /// Distance between rows.
    stride: usize,
}

impl Scratch {
    /// Makes room for `rows` x `columns` of any values, keeping the allocation if it is large enough.
    pub fn resize<L: Lanes>(&mut self, rows: usize, columns: usize) {
        let [rows, columns] = [rows, columns].map(|n| n.next_multiple_of(tile_rows::<L>()));
        self.stride = columns.next_multiple_of(LANES);
        let needed = rows * self.stride;
        if self.values.len() < needed {
            self.values = Buffer::new(needed);
        }
    }

    /// The first row, and the elements from row to row. Checks that there is room for `rows` rows of `columns` elements.
    #[inline(always)]
    pub fn memory(&self, rows: usize, columns: usize) -> (*const f32, usize) {
        self.check(rows, columns);
        (self.values.as_ptr(), self.stride)
    }

    /// As [`Scratch::memory`].
    #[inline(always)]
    pub fn memory_mut(&mut self, rows: usize, columns: usize) -> (*mut f32, usize) {
        self.check(rows, columns);
        (self.values.as_mut_ptr(), self.stride)
    }

    /// This matrix as the left operand of a product.
    #[inline(always)]
    pub fn plain(&self) -> Left<'_, false> {
        Left::new(&self.values, self.stride)
    }

    /// The transpose of this matrix as the left operand of a product.
    #[inline(always)]
    pub fn transposed(&self) -> Left<'_, true> {
        Left::new(&self.values, self.stride)
    }

    /// Becomes the transpose of the `rows` x `columns` matrix `other`, with zeros in its padding.
    #[inline(always)]
    pub fn set_transposed<L: Lanes>(&mut self, other: &Scratch, rows: usize, columns: usize) {
        self.resize::<L>(columns.next_multiple_of(LANES), rows);
        for first in (0..rows).step_by(LANES) {
            for column in (0..columns).step_by(LANES) {
                let from = (&other.values[first * other.stride + column..], other.stride);
                let to = (&mut self.values[column * self.stride + first..], self.stride);
                transpose_block::<L>(from, [LANES.min(rows - first), LANES], to, LANES);
            }
        }
    }

    /// Sees that there are so many rows and columns, and columns to the end of a vector, which [`Scratch::place`] relies on.
    #[inline(always)]
    fn check(&self, rows: usize, columns: usize) {
        let columns = columns.next_multiple_of(LANES);
        let end = (rows.max(1) - 1) * self.stride + columns;
        assert!(
            columns <= self.stride && end <= self.values.len(),
            "a scratch matrix is too small"
        );
    }

    /// Where the vector from column `j` of row `i` on lies, if there is one: see [`Scratch::check`].
    #[inline(always)]
    fn place(&self, i: usize, j: usize) -> *const [f32; LANES] {
        self.values.as_ptr().wrapping_add(i * self.stride + j).cast()
    }

    /// As [`Scratch::place`].
    #[inline(always)]
    fn place_mut(&mut self, i: usize, j: usize) -> *mut [f32; LANES] {
        self.values.as_mut_ptr().wrapping_add(i * self.stride + j).cast()
    }
}

/// The left operand of a product: a matrix, or the transpose of one.
#[derive(Clone, Copy)]
pub struct Left<'a, const TRANSPOSED: bool> {
    values: &'a [f32],
    stride: usize,
}

impl<'a, const TRANSPOSED: bool> Left<'a, TRANSPOSED> {
    /// A matrix of rows `stride` elements apart, or its transpose.
    #[inline(always)]
    fn new(values: &'a [f32], stride: usize) -> Self {
        Self { values, stride }
    }

    /// The operand from row `i` on.
    #[inline(always)]
    pub fn skip_rows(self, i: usize) -> Self {
        Self { values: &self.values[self.place(i, 0)..], ..self }
    }

    #[inline(always)]
    fn place(&self, row: usize, inner: usize) -> usize {
        if TRANSPOSED { inner * self.stride + row } else { row * self.stride + inner }
    }

    /// Sees that there are so many rows and inner elements, which [`Left::at`] relies on.
    #[inline(always)]
    fn check(&self, rows: usize, inner: usize) {
        let last = self.place(rows.max(1) - 1, inner.max(1) - 1);
        assert!(last < self.values.len(), "a product reads beyond its left operand");
    }

    /// # Safety
    ///
    /// There must be such a row and inner element: see [`Left::check`].
    #[inline(always)]
    unsafe fn at(&self, row: usize, inner: usize) -> f32 {
        // SAFETY: the caller's promise.
        unsafe { *self.values.get_unchecked(self.place(row, inner)) }
    }
}

/// The extent of a block of [`tile_rows`] rows of a product: part of the inner dimension, and the number of result
/// columns.
pub struct Span {
    pub inner: Range<usize>,
    pub columns: usize,
}

/// `out = left right` for the first `rows` rows, each block of rows within its span.
///
/// Columns are computed to the end of a half of a vector at least, and rows to the end of a tile.
#[inline(always)]
pub fn product<L: Lanes, const TRANSPOSED: bool>(
    out: &mut Scratch,
    rows: usize,
    left: Left<'_, TRANSPOSED>,
    right: &Scratch,
    span: impl Fn(usize) -> Span,
) {
    for first in (0..rows).step_by(tile_rows::<L>()) {
        block::<L, _>(out, first, left.skip_rows(first), right, span(first));
    }
}

/// The block of [`tile_rows`] rows of `out` that starts at `row`: the first ones of `left`, times
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
    left.check(tile_rows::<L>(), inner.end);
    right.check(inner.end, columns);
    out.check(row + tile_rows::<L>(), columns);
    let mut column = 0;
    while column < columns {
        let (to, inner) = ((row, column), inner.clone());
        let is_half = columns - column <= LANES / 2;
        column += LANES;
        match L::TILE {
            Tile::SixByFour if column < columns => {
                tile::<L, ROWS, 2, _, false>(out, to, left, right, inner);
                column += LANES;
            }
            Tile::SixByFour => tile::<L, ROWS, 1, _, false>(out, to, left, right, inner),
            _ if is_half => tile::<L, FEW, 1, _, true>(out, to, left, right, inner),
            _ => tile::<L, FEW, 1, _, false>(out, to, left, right, inner),
        }
    }
}

/// One tile of the result at `(row, column)`, of the first `R` rows of `left` and `V` vectors, or the first half of each.
#[inline(always)]
fn tile<L: Lanes, const R: usize, const V: usize, const TRANSPOSED: bool, const HALF: bool>(
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
            *vector = L::load(unsafe { &*right.place(k, column + v * LANES) });
        }
        for (r, sums) in sums.iter_mut().enumerate() {
            // SAFETY: `block` has checked.
            let left = L::splat(unsafe { left.at(r, k) });
            for (sum, right) in sums.iter_mut().zip(vectors) {
                *sum = left.mul_add(right, *sum);
            }
        }
    }
    for (r, sums) in sums.iter().enumerate() {
        for (v, sum) in sums.iter().enumerate() {
            // SAFETY: `block` has checked.
            let to = unsafe { &mut *out.place_mut(row + r, column + v * LANES) };
            // The compiler leaves out what is not stored.
            if HALF { sum.store_half(to) } else { sum.store(to) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::vectors::vectorised;
    use super::*;

    vectorised! {
        fn transpose(from: &Scratch, rows: usize, columns: usize, to: &mut Scratch) {
            to.set_transposed::<L>(from, rows, columns);
        }
    }

    #[test]
    fn a_transpose_has_rows_for_columns_and_zeros_around_them() {
        let (mut from, mut to) = (Scratch::default(), Scratch::default());
        for (rows, columns) in [(40, 33), (1, 1), (16, 16), (17, 5), (5, 17)] {
            from.resize::<[f32; LANES]>(rows, columns);
            let numbers = 1..;
            from.values.iter_mut().zip(numbers).for_each(|(x, n)| *x = n as f32);
            transpose(&from, rows, columns, &mut to);
            for j in 0..columns {
                let column = (0..rows).map(|i| from.values[i * from.stride + j]);
                let (padding, width) = (std::iter::repeat(0.0), rows.next_multiple_of(LANES));
                let expected = column.chain(padding).take(width);
                let found = to.values[j * to.stride..][..width].iter().copied();
                assert!(expected.eq(found), "{rows} x {columns}, column {j}");
            }
        }
    }
}
