//! Memory layout of the operands of a product.

use std::ops::Range;

use super::buffers::Buffer;
use super::lanes::LANES;
use super::vectors::vectorised;

/// Columns of a panel.
pub const PANEL: usize = 2 * LANES;

/// A matrix in memory: element (i, j) lies at `i row_stride + j column_stride`.
#[derive(Clone, Copy)]
pub struct View<'a> {
    values: &'a [f32],
    row_stride: usize,
    column_stride: usize,
}

impl<'a> View<'a> {
    /// Rows of `columns` elements, one after another.
    pub fn new(values: &'a [f32], columns: usize) -> Self {
        Self { values, row_stride: columns, column_stride: 1 }
    }

    /// Rows for columns.
    #[inline(always)]
    pub fn transposed(self) -> Self {
        let Self { values, row_stride, column_stride } = self;
        Self { values, row_stride: column_stride, column_stride: row_stride }
    }

    /// Whether the elements of a column lie side by side, and those of a row far apart.
    #[inline(always)]
    pub fn is_transposed(&self) -> bool {
        self.row_stride == 1 && self.column_stride > 1
    }

    /// Writes `rows` rows of `depth` elements as tiles of `R` rows, column after column; the last tile is filled up
    /// with its last row. The matrix must have as many: see [`View::check`].
    #[inline(always)]
    pub fn copy_tiles<const R: usize>(self, rows: Range<usize>, depth: usize, tiles: &mut [f32]) {
        for (first, tile) in rows.clone().step_by(R).zip(tiles.chunks_mut(R * depth)) {
            for (k, column) in tile.as_chunks_mut::<R>().0.iter_mut().enumerate() {
                for (r, to) in column.iter_mut().enumerate() {
                    // SAFETY: the caller has checked.
                    *to = unsafe { self.at((first + r).min(rows.end - 1), k) };
                }
            }
        }
    }

    /// The matrix from row `i` on.
    #[inline(always)]
    pub fn skip_rows(self, i: usize) -> Self {
        Self { values: &self.values[i * self.row_stride..], ..self }
    }

    /// The matrix from column `j` on.
    #[inline(always)]
    pub fn skip_columns(self, j: usize) -> Self {
        Self { values: &self.values[j * self.column_stride..], ..self }
    }

    /// Sees that the matrix has so many rows and columns, which [`View::at`] relies on.
    #[inline(always)]
    pub fn check(&self, rows: usize, columns: usize) {
        let last = (rows.max(1) - 1) * self.row_stride + (columns.max(1) - 1) * self.column_stride;
        assert!(last < self.values.len(), "a matrix of {rows} x {columns} ends beyond its memory");
    }

    /// Element (i, j).
    ///
    /// # Safety
    ///
    /// The matrix must have a row i and a column j: see [`View::check`].
    #[inline(always)]
    pub unsafe fn at(&self, i: usize, j: usize) -> f32 {
        // SAFETY: the caller's promise.
        unsafe { *self.values.get_unchecked(i * self.row_stride + j * self.column_stride) }
    }
}

/// The right operand of a product: panels of [`PANEL`] columns, row after row, the last panel
/// filled up with zeros.
#[derive(Default)]
pub struct Panels {
    values: Buffer,
    inner: usize,
    columns: usize,
}

impl Panels {
    /// The first `inner` rows and `columns` columns of `matrix`, in panels.
    pub fn of(matrix: View<'_>, inner: usize, columns: usize) -> Self {
        let mut panels = Self::default();
        panels.pack(matrix, inner, columns);
        panels
    }

    /// As [`Panels::of`], in the same memory.
    pub fn pack(&mut self, matrix: View<'_>, inner: usize, columns: usize) {
        matrix.check(inner, columns);
        (self.inner, self.columns) = (inner, columns);
        let needed = inner * columns.next_multiple_of(PANEL);
        if self.values.len() < needed {
            self.values = Buffer::new(needed);
        }
        let panels = self.values[..needed].chunks_exact_mut(inner * PANEL);
        for (panel, column) in panels.zip((0..columns).step_by(PANEL)) {
            let columns = PANEL.min(columns - column);
            fill(panel.as_chunks_mut().0, matrix.skip_columns(column), columns);
        }
    }

    /// Rows of the matrix, the inner dimension of the product.
    #[inline(always)]
    pub fn inner(&self) -> usize {
        self.inner
    }

    /// Columns of the matrix.
    #[inline(always)]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The panel that starts at `column`, of the rows `rows`.
    #[inline(always)]
    pub fn part(&self, column: usize, rows: Range<usize>) -> Part<'_> {
        let start = self.inner * column;
        let rows = &self.values[start + rows.start * PANEL..start + rows.end * PANEL];
        Part { rows: rows.as_chunks().0, columns: PANEL.min(self.columns - column) }
    }
}

/// Rows of one panel.
#[derive(Clone, Copy)]
pub struct Part<'a> {
    pub rows: &'a [[f32; PANEL]],
    /// Columns of the matrix.
    pub columns: usize,
}

impl Part<'_> {
    /// Whether one vector is enough for the columns without padding.
    #[inline(always)]
    pub fn is_narrow(self) -> bool {
        self.columns <= LANES
    }
}

/// Writes one panel.
fn fill(panel: &mut [[f32; PANEL]], matrix: View<'_>, columns: usize) {
    if matrix.column_stride == 1 {
        fill_rows(panel, matrix.values, matrix.row_stride, columns);
    } else {
        fill_strided(panel, matrix, columns);
    }
}

vectorised! {
    /// As [`fill`], from rows that lie in one piece each. A single row may have any stride.
    fn fill_rows(panel: &mut [[f32; PANEL]], values: &[f32], stride: usize, columns: usize) {
        for (row, source) in panel.iter_mut().zip(values.chunks(stride.max(columns))) {
            let (low, high) = row.split_at_mut(LANES);
            let (source, rest) = source[..columns].split_at(columns.min(LANES));
            L::read(source).write(low);
            L::read(rest).write(high);
        }
    }
}

/// As [`fill`], from columns that lie in one piece; eight at a time, so that lines of the cache
/// are read once and written once.
fn fill_strided(panel: &mut [[f32; PANEL]], matrix: View<'_>, columns: usize) {
    panel.iter_mut().for_each(|row| row[columns..].fill(0.0));
    for (first, block) in panel.chunks_mut(LANES).enumerate() {
        for j in 0..columns {
            let column = &matrix.values[j * matrix.column_stride..];
            for (i, row) in block.iter_mut().enumerate() {
                row[j] = column[(first * LANES + i) * matrix.row_stride];
            }
        }
    }
}
