//! One tile of a product, in registers.

use super::panels::{Part, View};
use crate::ops::own::lanes::{LANES, Lanes};

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
    pub fn reborrow(&mut self) -> Target<'_> {
        Target { values: self.values, stride: self.stride }
    }

    /// Sees that so many rows and columns have room.
    pub fn check(&self, rows: usize, columns: usize) {
        let end = (rows.max(1) - 1) * self.stride + columns;
        assert!(end <= self.values.len(), "a result of {rows} x {columns} has no room");
    }

    /// Up to a vector of row `i` from column `j` on, of which `columns` are left.
    #[inline(always)]
    fn lanes(&mut self, i: usize, j: usize, columns: usize) -> &mut [f32] {
        &mut self.values[i * self.stride + j..][..columns.min(LANES)]
    }
}

/// The first `count` of `R` rows at `(row, column)`, against `V` vectors of a panel at a time.
///
/// `left` starts at the first inner element and has been checked; rows after the last are computed
/// from the last and thrown away.
#[inline(always)]
pub fn tile<L: Lanes, const R: usize, const V: usize>(
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
        let mut sums = [[L::splat(0.0); V]; R];
        if add {
            for_each::<R, V>(count, panel.columns - from, |r, v, left| {
                sums[r][v] = L::read(target.lanes(rows[r], column + from + v * LANES, left));
            });
        }
        accumulate::<L, R, V>(&mut sums, rows, left, panel, from);
        for_each::<R, V>(count, panel.columns - from, |r, v, left| {
            sums[r][v].write(target.lanes(rows[r], column + from + v * LANES, left));
        });
        from += V * LANES;
    }
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

/// The multiply-adds of a tile, from column `from` of the panel on.
#[inline(always)]
fn accumulate<L: Lanes, const R: usize, const V: usize>(
    sums: &mut [[L; V]; R],
    rows: [usize; R],
    left: View<'_>,
    panel: Part<'_>,
    from: usize,
) {
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
}
