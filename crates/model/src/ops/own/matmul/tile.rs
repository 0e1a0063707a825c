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
