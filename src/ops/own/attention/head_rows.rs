//! Rows of one head in the matrices of all heads, and their way from there to a [`Scratch`] and
//! back.

use std::ops::Range;

use crate::ops::own::lanes::{LANES, Lanes};
use crate::ops::own::scratch::Scratch;

/// Rows of `columns` elements, `stride` elements apart.
#[derive(Clone, Copy)]
pub struct HeadRows {
    pub start: usize,
    pub stride: usize,
    pub columns: usize,
}

impl HeadRows {
    /// Whether rows are whole vectors. Known to the compiler, it saves attention a tenth of its time.
    #[inline(always)]
    pub fn is_whole(self) -> bool {
        self.columns.is_multiple_of(LANES)
    }

    /// Row `t`.
    #[inline(always)]
    pub fn row(self, values: &[f32], t: usize) -> &[f32] {
        &values[self.start + t * self.stride..][..self.columns]
    }

    /// Row `t`.
    #[inline(always)]
    pub fn row_mut(self, values: &mut [f32], t: usize) -> &mut [f32] {
        &mut values[self.start + t * self.stride..][..self.columns]
    }
}

/// The vector of a row from column `j` on; if the row does not end with a whole one, with zeros
/// after its end.
#[inline(always)]
pub fn read<L: Lanes, const WHOLE: bool>(row: &[f32], j: usize) -> L {
    L::read(&row[j..end::<WHOLE>(row, j)])
}

/// Writes what [`read`] reads.
#[inline(always)]
pub fn write<L: Lanes, const WHOLE: bool>(row: &mut [f32], j: usize, vector: L) {
    let end = end::<WHOLE>(row, j);
    vector.write(&mut row[j..end]);
}

#[inline(always)]
fn end<const WHOLE: bool>(row: &[f32], j: usize) -> usize {
    if WHOLE { j + LANES } else { row.len().min(j + LANES) }
}

/// Reads `rows` rows.
#[inline(always)]
pub fn load<L: Lanes>(to: &mut Scratch, from: (&[f32], HeadRows), rows: usize) {
    if from.1.is_whole() {
        load_as::<L, true>(to, from, rows);
    } else {
        load_as::<L, false>(to, from, rows);
    }
}

#[inline(always)]
fn load_as<L: Lanes, const WHOLE: bool>(
    to: &mut Scratch,
    (values, place): (&[f32], HeadRows),
    rows: usize,
) {
    for t in 0..rows {
        let (to, from) = (to.row_mut(t), place.row(values, t));
        for j in (0..place.columns).step_by(LANES) {
            write::<L, true>(to, j, read::<L, WHOLE>(from, j));
        }
    }
}

/// Writes the rows `rows` from the first ones of `from`.
#[inline(always)]
pub fn store<L: Lanes>(to: (&mut [f32], HeadRows), rows: Range<usize>, from: &Scratch) {
    if to.1.is_whole() {
        store_as::<L, true>(to, rows, from);
    } else {
        store_as::<L, false>(to, rows, from);
    }
}

#[inline(always)]
fn store_as<L: Lanes, const WHOLE: bool>(
    (values, place): (&mut [f32], HeadRows),
    rows: Range<usize>,
    from: &Scratch,
) {
    for (i, t) in rows.enumerate() {
        let (to, from) = (place.row_mut(values, t), from.row(i));
        for j in (0..place.columns).step_by(LANES) {
            write::<L, WHOLE>(to, j, read::<L, true>(from, j));
        }
    }
}
