//! [`Scratch`]: a small matrix that kernels work in.

use super::lanes::{LANES, Lanes};
use super::left::Left;

/// Rows of a tile; scratch matrices hold a multiple of these.
pub const ROWS: usize = 8;

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

    /// Rows from row `i` on, their padding included.
    #[inline(always)]
    pub fn rows_mut(&mut self, i: usize) -> impl Iterator<Item = &mut [f32]> {
        self.values[i * self.stride..].chunks_mut(self.stride)
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
        self.resize(columns.next_multiple_of(LANES), rows);
        for first in (0..rows).step_by(LANES) {
            for column in (0..columns).step_by(LANES) {
                let mut block = [L::splat(0.0); LANES];
                for (i, row) in (first..rows.min(first + LANES)).enumerate() {
                    block[i] = L::read(&other.row(row)[column..column + LANES]);
                }
                let to = &mut self.values[column * self.stride + first..];
                for (row, vector) in to.chunks_mut(self.stride).zip(L::transpose(block)) {
                    vector.write(&mut row[..LANES]);
                }
            }
        }
    }

    /// Sees that there are so many rows and columns, which [`Scratch::vector`] relies on.
    #[inline(always)]
    pub fn check(&self, rows: usize, columns: usize) {
        let last = (rows.max(1) - 1) * self.stride + columns.next_multiple_of(LANES);
        assert!(last <= self.values.len(), "a product reads beyond its right operand");
    }

    /// The vector that starts at column `j` of row `i`.
    ///
    /// # Safety
    ///
    /// There must be such a vector: see [`Scratch::check`].
    #[inline(always)]
    pub unsafe fn vector<L: Lanes>(&self, i: usize, j: usize) -> L {
        // SAFETY: the caller's promise.
        L::load(unsafe { &*self.values.as_ptr().add(i * self.stride + j).cast() })
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::vectorised;
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
            from.resize(rows, columns);
            let numbers = 1..;
            from.values.iter_mut().zip(numbers).for_each(|(x, n)| *x = n as f32);
            transpose(&from, rows, columns, &mut to);
            for j in 0..columns {
                let column = (0..rows).map(|i| from.row(i)[j]);
                let padding = std::iter::repeat(0.0);
                let expected = column.chain(padding).take(rows.next_multiple_of(LANES));
                assert!(expected.eq(to.row(j).iter().copied()), "{rows} x {columns}, column {j}");
            }
        }
    }
}
