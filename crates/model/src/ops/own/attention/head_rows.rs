//! Rows of one head in the matrices of all heads.

use crate::ops::own::lanes::{LANES, Lanes};

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
