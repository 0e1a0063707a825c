//! Memory layout of the operands of a product.

use std::ops::Range;

use super::buffers::{Buffer, prefetch};
use super::lanes::{LANES, Lanes};
use super::vectors::vectorised;

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
    /// with its last row.
    #[inline(always)]
    pub fn copy_tiles<const R: usize>(self, rows: Range<usize>, depth: usize, tiles: &mut [f32]) {
        let whole = if self.row_stride == 1 { rows.len() / R } else { 0 };
        for k in 0..depth {
            let column = &self.values[rows.start * self.row_stride + k * self.column_stride..];
            let from = column.as_chunks::<R>().0.iter().take(whole);
            for (from, tile) in from.zip(tiles.chunks_exact_mut(R * depth)) {
                tile[k * R..][..R].copy_from_slice(from);
            }
        }
        let rest = (rows.start + whole * R..rows.end).step_by(R);
        for (first, tile) in rest.zip(tiles.chunks_exact_mut(R * depth).skip(whole)) {
            for r in 0..R {
                let row = self.skip_rows((first + r).min(rows.end - 1)).values;
                let from = row.iter().step_by(self.column_stride);
                tile.iter_mut().skip(r).step_by(R).zip(from).for_each(|(to, from)| *to = *from);
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

    /// Sees that the matrix has so many rows and columns, which [`View::place`] relies on.
    #[inline(always)]
    pub fn check(&self, rows: usize, columns: usize) {
        let last = (rows.max(1) - 1) * self.row_stride + (columns.max(1) - 1) * self.column_stride;
        assert!(last < self.values.len(), "a matrix of {rows} x {columns} ends beyond its memory");
    }

    /// Where element (i, j) lies, if there is one: see [`View::check`].
    #[inline(always)]
    pub fn place(&self, i: usize, j: usize) -> *const f32 {
        self.values.as_ptr().wrapping_add(i * self.row_stride + j * self.column_stride)
    }

    /// Elements from row to row.
    #[inline(always)]
    pub fn row_stride(&self) -> usize {
        self.row_stride
    }

    /// Elements from column to column.
    #[inline(always)]
    pub fn column_stride(&self) -> usize {
        self.column_stride
    }
}

/// The columns of `matrix`, `columns` of them, as rows.
pub fn transposed(matrix: &[f32], columns: usize) -> Buffer {
    let mut output = Buffer::new(matrix.len());
    transpose(matrix, columns, &mut output);
    output
}

vectorised! {
    fn transpose(matrix: &[f32], columns: usize, output: &mut [f32]) {
        let rows = matrix.len() / columns;
        for first in (0..rows).step_by(LANES) {
            for column in (0..columns).step_by(LANES) {
                let size = [rows - first, columns - column].map(|n| n.min(LANES));
                let from = (&matrix[first * columns + column..], columns);
                let to = (&mut output[column * rows + first..], rows);
                transpose_block::<L>(from, size, to, size[0]);
            }
        }
    }
}

/// Writes the columns of a block of up to sixteen rows and columns as rows of `width` elements, zeros after those that
/// there are; each matrix with the elements from row to row.
#[inline(always)]
pub fn transpose_block<L: Lanes>(
    (from, stride): (&[f32], usize),
    [rows, columns]: [usize; 2],
    to: (&mut [f32], usize),
    width: usize,
) {
    if [rows, columns] == [LANES; 2] {
        return L::transpose((from, stride), to);
    }
    let [mut block, mut turned] = [[[0.0; LANES]; LANES]; 2];
    for (row, from) in block.iter_mut().zip(from.chunks(stride)).take(rows) {
        L::read(&from[..columns]).store(row);
    }
    L::transpose((block.as_flattened(), LANES), (turned.as_flattened_mut(), LANES));
    for (row, to) in turned.iter().zip(to.0.chunks_mut(to.1)).take(columns) {
        L::load(row).write(&mut to[..width]);
    }
}

/// The right operand of a product: panels of as many columns as a tile of this machine has, row after row, the last
/// panel filled up with zeros.
#[derive(Default)]
pub struct Panels {
    values: Buffer,
    inner: usize,
    columns: usize,
    /// Columns of a panel.
    width: usize,
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
        (self.inner, self.columns, self.width) = (inner, columns, width());
        let needed = inner * columns.next_multiple_of(self.width);
        if self.values.len() < needed {
            self.values = Buffer::new(needed);
        }
        fill(&mut self.values[..needed], matrix, inner, columns);
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

    /// The columns `columns` cut where panels start.
    #[inline(always)]
    pub fn pieces(&self, columns: Range<usize>) -> impl Iterator<Item = Range<usize>> + use<> {
        let (start, end, width) = (columns.start, columns.end, self.width);
        let starts = (start / width * width..end).step_by(width);
        starts.map(move |first| first.max(start)..end.min(first + width))
    }

    /// The rows `rows` of the panel that `column` lies in, from this column on; from row to row are `W` elements, as
    /// many as the columns of a panel.
    #[inline(always)]
    pub fn part<const W: usize>(&self, column: usize, rows: Range<usize>) -> &[f32] {
        assert_eq!(self.width, W, "panels are filled and read with one kind of vectors");
        let start = self.inner * (column / W * W);
        &self.values[start + rows.start * W + column % W..start + rows.end * W]
    }
}

vectorised! {
    /// Columns of a panel.
    fn width() -> usize {
        L::TILE.columns()
    }
}

vectorised! {
    /// Writes all panels.
    fn fill(panels: &mut [f32], matrix: View<'_>, inner: usize, columns: usize) {
        let width = L::TILE.columns();
        for (panel, first) in panels.chunks_exact_mut(inner * width).zip((0..columns).step_by(width)) {
            let (count, matrix) = (width.min(columns - first), matrix.skip_columns(first));
            if matrix.column_stride == 1 {
                fill_rows::<L>(panel, width, matrix, count);
            } else {
                fill_columns::<L>(panel, width, matrix, count);
            }
        }
    }
}

/// Elements between those of a column that are read and those that are fetched for later.
const AHEAD: usize = 64;

/// Writes one panel from rows that lie in one piece each. A single row may have any stride.
#[inline(always)]
fn fill_rows<L: Lanes>(panel: &mut [f32], width: usize, matrix: View<'_>, columns: usize) {
    let sources = matrix.values.chunks(matrix.row_stride.max(columns));
    for (row, source) in panel.chunks_exact_mut(width).zip(sources) {
        // The next panel reads it.
        prefetch(source.as_ptr().wrapping_add(width));
        let (whole, rest) = source[..columns].as_chunks::<LANES>();
        let mut to = row.as_chunks_mut::<LANES>().0.iter_mut();
        // In this order, since `zip` takes one more of its first.
        for (from, to) in whole.iter().zip(to.by_ref()) {
            L::load(from).store(to);
        }
        let mut rest = L::read(rest);
        for to in to {
            rest.store(to);
            rest = L::splat(0.0);
        }
    }
}

/// The same from columns that lie in one piece each, a square block at a time.
#[inline(always)]
fn fill_columns<L: Lanes>(panel: &mut [f32], width: usize, matrix: View<'_>, columns: usize) {
    for (i, rows) in panel.chunks_mut(LANES * width).enumerate() {
        let inner = rows.len() / width;
        for j in (0..width).step_by(LANES) {
            let stride = matrix.column_stride;
            let from = &matrix.values[(j * stride + i * LANES).min(matrix.values.len())..];
            for k in 0..LANES {
                prefetch(from.as_ptr().wrapping_add(k * stride + AHEAD));
            }
            let size = [columns.saturating_sub(j).min(LANES), inner];
            transpose_block::<L>((from, stride), size, (&mut rows[j..], width), LANES);
        }
    }
}
