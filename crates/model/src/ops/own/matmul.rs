//! Products of large matrices: the linear layers, the head, and their gradients.
//!
//! The right operand is copied into [`Panels`] first, so that what a tile reads of it lies in one
//! piece; the left operand is read where it lies, or from a copy in tiles. A [`Tile`] stays in registers
//! for up to [`DEPTH`] multiply-adds an element. Every element is summed in the order of the inner
//! dimension, whatever the tile, so the bits are those of every machine that multiplies and adds in one step.
//!
//! While a tile is computed, the next panel and the next tile of the result are prefetched.

use std::ops::Range;
use std::slice;
use std::sync::atomic::{Ordering, compiler_fence};

use super::buffers::{Buffer, prefetch};
use super::lanes::{LANES, Lanes, Tile};
use super::panels::{Panels, View};
use super::vectors::vectorised;

/// Inner elements between two visits of the result: a panel of as many stays in the caches.
const DEPTH: usize = 256;

/// Rows that meet a panel before the next panel comes: they stay in the second cache. Whole tiles of any kind.
const BLOCK: usize = 192;

/// Elements of a line of the cache.
const LINE: usize = 16;

/// Inner elements of one pass of the unrolled loop. Two threads of a core share its decoder, so instructions other than
/// multiply-adds cost speed.
const UNROLLED: usize = 4;

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
    fn reborrow(&mut self) -> Target<'_> {
        Target { values: self.values, stride: self.stride }
    }

    /// Sees that so many rows and columns have room.
    fn check(&self, rows: usize, columns: usize) {
        let end = (rows.max(1) - 1) * self.stride + columns;
        assert!(end <= self.values.len(), "a result of {rows} x {columns} has no room");
    }

    /// Where element (i, j) lies, if there is one: see [`Target::check`].
    #[inline(always)]
    fn place(&mut self, i: usize, j: usize) -> *mut f32 {
        self.values.as_mut_ptr().wrapping_add(i * self.stride + j)
    }

    /// `columns` elements of row `i`, from column `j` on.
    #[inline(always)]
    fn row(&mut self, i: usize, j: usize, columns: usize) -> &mut [f32] {
        &mut self.values[i * self.stride + j..][..columns]
    }
}

/// What a product is added to.
#[derive(Clone, Copy)]
pub enum Start<'a> {
    Zero,
    /// What the target holds.
    Target,
    /// A matrix of rows in one piece each, or of one row again and again, 0 elements apart.
    Rows(View<'a>),
}

impl Start<'_> {
    /// Sees that there are so many rows and columns.
    fn check(&self, rows: usize, columns: usize) {
        if let Self::Rows(matrix) = self {
            assert_eq!(matrix.column_stride(), 1, "rows to start from lie in one piece each");
            matrix.check(rows, columns);
        }
    }

    /// Where element (i, j) lies, if there is one, and the elements from row to row: see [`Start::check`].
    #[inline(always)]
    fn place(&self, target: &mut Target<'_>, i: usize, j: usize) -> (*const f32, usize) {
        match *self {
            Self::Zero | Self::Target => (target.place(i, j).cast_const(), target.stride),
            Self::Rows(matrix) => (matrix.place(i, j), matrix.row_stride()),
        }
    }
}

/// `target = start + left right`, for `rows` rows.
pub fn multiply(target: Target<'_>, rows: usize, left: View<'_>, right: &Panels, start: Start<'_>) {
    multiply_part(target, rows, left, right, 0..right.columns(), 0..right.inner(), start);
}

/// As [`multiply`], by the columns and inner rows of `right` alone that are given; `left`, `target` and `start` begin
/// at the first of them, which must be the first of a vector.
pub fn multiply_part(
    target: Target<'_>,
    rows: usize,
    left: View<'_>,
    right: &Panels,
    columns: Range<usize>,
    inner: Range<usize>,
    start: Start<'_>,
) {
    assert!(columns.start.is_multiple_of(LANES), "column {} starts no vector", columns.start);
    left.check(rows, inner.len());
    target.check(rows, columns.len());
    start.check(rows, columns.len());
    blocks(target, rows, left, right, columns, inner, start);
}

/// `target = leftᵀ right` over the rows `inner` of a batch, or `target += leftᵀ right` but for its first rows. Both
/// operands start at the first of these rows; `panels` is room to work in.
///
/// `left` has as many columns as `target` has rows.
pub fn multiply_transposed(
    mut target: Target<'_>,
    (rows, columns): (usize, usize),
    left: View<'_>,
    right: View<'_>,
    inner: &Range<usize>,
    panels: &mut Panels,
) {
    let (start, inner) = (inner.start, inner.len());
    for first in (0..inner).step_by(DEPTH) {
        let depth = DEPTH.min(inner - first);
        panels.pack(right.skip_rows(first), depth, columns);
        let left = left.skip_rows(first).transposed();
        let from = if start + first > 0 { Start::Target } else { Start::Zero };
        multiply(target.reborrow(), rows, left, panels, from);
    }
}

vectorised! {
    fn blocks(
        target: Target<'_>,
        rows: usize,
        left: View<'_>,
        right: &Panels,
        columns: Range<usize>,
        inner: Range<usize>,
        start: Start<'_>,
    ) {
        let mut target = target;
        let of = (&mut target, rows, left, right);
        match L::TILE {
            Tile::SixByFour => tiles::<L, 6, 4, 64>(of, columns, inner, start),
            Tile::SixByOne => tiles::<L, 6, 1, 16>(of, columns, inner, start),
            Tile::FourByOne => tiles::<L, 4, 1, 16>(of, columns, inner, start),
        }
    }
}

/// A product by tiles of `R` rows and `V` vectors, which are `W` columns.
#[inline(always)]
fn tiles<L: Lanes, const R: usize, const V: usize, const W: usize>(
    (target, rows, left, right): (&mut Target<'_>, usize, View<'_>, &Panels),
    columns: Range<usize>,
    inner: Range<usize>,
    start: Start<'_>,
) {
    // A tile of four vectors reads the left operand a quarter as often.
    let copies = left.is_transposed() && columns.len() >= if V == 1 { 96 } else { 256 };
    let mut copy = Buffer::new(if copies { BLOCK * DEPTH } else { R * DEPTH });
    let mut edge = [[0.0; W]; R];
    for block in (0..rows).step_by(BLOCK) {
        let block = block..rows.min(block + BLOCK);
        let copied = if copies { block.start } else { block.end - block.len() % R };
        for first in inner.clone().step_by(DEPTH) {
            let depth = first..inner.end.min(first + DEPTH);
            let start = if first > inner.start { Start::Target } else { start };
            let left = left.skip_columns(first - inner.start);
            if copied < block.end {
                left.copy_tiles::<R>(copied..block.end, depth.len(), &mut copy);
            }
            for piece in right.pieces(columns.clone()) {
                let panel = right.part::<W>(piece.start, depth.clone());
                // Each tile prefetches a part of the next panel.
                let is_last = piece.end == columns.end;
                let next = if is_last { &[] } else { right.part::<W>(piece.end, depth.clone()) };
                let mut shares =
                    next.chunks((next.len() / block.len() * R).next_multiple_of(LINE) + LINE);
                for row in block.clone().step_by(R) {
                    for line in shares.next().unwrap_or_default().chunks(LINE) {
                        prefetch(line.as_ptr());
                    }
                    let at = (row, piece.start - columns.start);
                    let to = (&mut *target, at, (R.min(block.end - row), piece.len()));
                    // The compiler makes a loop of each, with what it knows of the strides.
                    if row >= copied {
                        let first = copy[(row - copied) * depth.len()..].as_ptr();
                        tile::<L, R, V, W>(
                            to,
                            Rows { first, row: 1, inner: R },
                            panel,
                            &mut edge,
                            start,
                        );
                    } else if left.is_transposed() {
                        let (first, inner) = (left.place(row, 0), left.column_stride());
                        tile::<L, R, V, W>(
                            to,
                            Rows { first, row: 1, inner },
                            panel,
                            &mut edge,
                            start,
                        );
                    } else {
                        let (first, row) = (left.place(row, 0), left.row_stride());
                        tile::<L, R, V, W>(
                            to,
                            Rows { first, row, inner: 1 },
                            panel,
                            &mut edge,
                            start,
                        );
                    }
                }
            }
        }
    }
}

// One tile of a product, in registers.

/// The left operand of a tile: element (r, k) lies `r row + k inner` elements after the first.
#[derive(Clone, Copy)]
struct Rows {
    first: *const f32,
    row: usize,
    inner: usize,
}

/// The tile at a place of the result, of at most `R` rows and `V` vectors.
///
/// `left` has `R` rows, and as many inner elements as `panel`, of `W` columns, has rows. A tile of fewer rows, or
/// of columns that are no whole vectors, is computed in `edge`.
#[inline(always)]
fn tile<L: Lanes, const R: usize, const V: usize, const W: usize>(
    (target, (i, j), (rows, columns)): (&mut Target<'_>, (usize, usize), (usize, usize)),
    left: Rows,
    panel: &[f32],
    edge: &mut [[f32; W]; R],
    start: Start<'_>,
) {
    let is_full = columns == V * LANES;
    let is_whole = rows == R && (is_full || V > 1 && columns.is_multiple_of(LANES));
    let (to, stride) = if is_whole {
        (target.place(i, j), target.stride)
    } else {
        (edge.as_flattened_mut().as_mut_ptr(), W)
    };
    // A narrower target is as short, and in the cache.
    if is_whole && is_full {
        for next in (0..R).flat_map(|r| (0..V).map(move |v| (R + r) * stride + v * LANES)) {
            prefetch(to.wrapping_add(next));
        }
    }
    let (add, mut from) = (!matches!(start, Start::Zero), start.place(target, i, j));
    if !is_whole {
        for (r, row) in edge.iter_mut().take(if add { rows } else { 0 }).enumerate() {
            // SAFETY: `multiply` has checked.
            copy::<L>(unsafe { slice::from_raw_parts(from.0.add(r * from.1), columns) }, row);
        }
        from = (to.cast_const(), W);
    }
    // SAFETY: `multiply` has checked, and `edge` has room.
    unsafe {
        match columns.div_ceil(LANES) {
            1 if V > 1 => accumulate::<L, R, 1, W, false>((to, stride), from, left, panel, add),
            1 if columns <= LANES / 2 => {
                accumulate::<L, R, V, W, true>((to, stride), from, left, panel, add);
            }
            2 if V > 2 => accumulate::<L, R, 2, W, false>((to, stride), from, left, panel, add),
            3 if V > 3 => accumulate::<L, R, 3, W, false>((to, stride), from, left, panel, add),
            _ => accumulate::<L, R, V, W, false>((to, stride), from, left, panel, add),
        }
    }
    if !is_whole {
        for (r, row) in edge.iter().take(rows).enumerate() {
            copy::<L>(row, target.row(i + r, j, columns));
        }
    }
}

/// Copies as many vectors as both have, up to the end of `to`.
#[inline(always)]
fn copy<L: Lanes>(from: &[f32], to: &mut [f32]) {
    for (from, to) in from.chunks(LANES).zip(to.chunks_mut(LANES)) {
        L::read(from).write(to);
    }
}

/// Writes the sums of a whole tile, or adds them to the rows at `from`, to the rows at `to`; each with the elements from
/// row to row. Of `HALF` a vector the second half is unspecified.
///
/// # Safety
///
/// There must be `R` rows of `V` vectors at both, as many rows of `left`, as many vectors in a row of `panel`, and an
/// inner element of `left` for each row of `panel`.
#[inline(always)]
unsafe fn accumulate<L: Lanes, const R: usize, const V: usize, const W: usize, const HALF: bool>(
    (to, stride): (*mut f32, usize),
    from: (*const f32, usize),
    mut left: Rows,
    panel: &[f32],
    add: bool,
) {
    let mut sums = [[L::splat(0.0); V]; R];
    if add {
        let (from, stride) = from;
        for (r, sums) in sums.iter_mut().enumerate() {
            for (v, sum) in sums.iter_mut().enumerate() {
                // SAFETY: the caller's promise.
                *sum = L::load(unsafe { &*from.add(r * stride + v * LANES).cast() });
            }
        }
    }
    let (mut right, depth) = (panel.as_ptr(), panel.len().div_ceil(W));
    for _ in 0..depth / UNROLLED {
        for k in 0..UNROLLED {
            // SAFETY: there are so many inner elements.
            unsafe {
                add_products(&mut sums, left.first.add(k * left.inner), left.row, right.add(k * W));
            }
            // Without it the compiler loads the next vectors early, into a register of the sums.
            compiler_fence(Ordering::SeqCst);
        }
        left.first = left.first.wrapping_add(UNROLLED * left.inner);
        right = right.wrapping_add(UNROLLED * W);
    }
    for k in 0..depth % UNROLLED {
        // SAFETY: as above.
        unsafe {
            add_products(&mut sums, left.first.add(k * left.inner), left.row, right.add(k * W));
        }
    }
    for (r, sums) in sums.iter().enumerate() {
        for (v, sum) in sums.iter().enumerate() {
            // SAFETY: the caller's promise.
            let to = unsafe { &mut *to.add(r * stride + v * LANES).cast() };
            // The compiler leaves out what is not stored.
            if HALF { sum.store_half(to) } else { sum.store(to) }
        }
    }
}

/// Adds the products of one inner element: of `R` numbers from `left` on, `row` elements apart, and the vectors at `right`.
///
/// # Safety
///
/// There must be so many numbers, and `V` vectors.
#[inline(always)]
unsafe fn add_products<L: Lanes, const R: usize, const V: usize>(
    sums: &mut [[L; V]; R],
    left: *const f32,
    row: usize,
    right: *const f32,
) {
    let mut vectors = [L::splat(0.0); V];
    for (v, vector) in vectors.iter_mut().enumerate() {
        // SAFETY: the caller's promise.
        *vector = L::load(unsafe { &*right.add(v * LANES).cast() });
    }
    for (r, sums) in sums.iter_mut().enumerate() {
        // SAFETY: the caller's promise.
        let left = L::splat(unsafe { *left.add(r * row) });
        for (sum, right) in sums.iter_mut().zip(vectors) {
            *sum = left.mul_add(right, *sum);
        }
    }
}
