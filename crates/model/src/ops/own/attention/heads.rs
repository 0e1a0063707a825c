//! One head of one sequence: its mask, its rows in the matrices of all heads, and copies to a [`Scratch`] and back, with
//! queries and keys rotated by their positions; see [`Rope`].

use std::ops::Range;
use std::slice;

use crate::ops::own::lanes::{LANES, Lanes};
use crate::ops::own::small_matrices::{ROWS, Scratch, tile_rows};
use crate::ops::{Rope, SequenceLayout};

/// The layout of heads and sequences in rows of `[q | k | v]` and of the output.
#[derive(Clone, Copy)]
pub struct Heads<'a> {
    pub layout: &'a SequenceLayout,
    pub rope: &'a Rope,
    pub n_head: usize,
    /// The row of the batch at which the slices that are worked on start.
    pub first_row: usize,
}

/// One head of one sequence.
#[derive(Clone, Copy)]
pub struct Head<'a> {
    layout: &'a SequenceLayout,
    sequence: usize,
    rope: &'a Rope,
    d_model: usize,
    /// The first row of the sequence, in the slices that are worked on.
    row: usize,
    pub len: usize,
    /// First feature of the head within d_model.
    column: usize,
}

impl<'a> Heads<'a> {
    pub fn d_model(&self) -> usize {
        self.n_head * self.rope.head_dim()
    }

    /// Every head of these sequences, in the order of their rows.
    pub fn each(self, sequences: Range<usize>) -> impl Iterator<Item = Head<'a>> {
        sequences
            .flat_map(move |sequence| (0..self.n_head).map(move |head| self.at(sequence, head)))
    }

    fn at(self, sequence: usize, head: usize) -> Head<'a> {
        Head {
            layout: self.layout,
            sequence,
            rope: self.rope,
            d_model: self.d_model(),
            row: self.layout.rows(sequence).start - self.first_row,
            len: self.layout.len(sequence),
            column: head * self.rope.head_dim(),
        }
    }
}

impl Head<'_> {
    /// The place of the head's part `part` (0 q, 1 k, 2 v) in `[n_rows, 3 d]`.
    #[inline(always)]
    pub fn part(&self, part: usize) -> HeadRows {
        let stride = 3 * self.d_model;
        let start = self.row * stride + part * self.d_model + self.column;
        HeadRows { start, stride, columns: self.head_dim() }
    }

    /// The place of the head's output in `[n_rows, d]`.
    #[inline(always)]
    pub fn output(&self) -> HeadRows {
        let start = self.row * self.d_model + self.column;
        HeadRows { start, stride: self.d_model, columns: self.head_dim() }
    }

    /// The angles of its positions.
    #[inline(always)]
    pub fn angles(&self) -> Angles<'_> {
        Angles { rope: self.rope, listed: self.layout.angles(self.sequence) }
    }
}

impl Sight for Head<'_> {
    #[inline(always)]
    fn head_dim(&self) -> usize {
        self.rope.head_dim()
    }

    #[inline(always)]
    fn n_queries(&self) -> usize {
        self.len
    }

    #[inline(always)]
    fn n_keys(&self) -> usize {
        self.len
    }

    #[inline(always)]
    fn visible(&self, q: usize) -> usize {
        self.layout.visible(self.sequence, q)
    }

    #[inline(always)]
    fn first_viewer(&self, k: usize) -> usize {
        self.layout.first_viewer(self.sequence, k)
    }
}

/// The queries and keys of one head, each query seeing the keys up to some place.
pub trait Sight {
    /// Features of the head.
    fn head_dim(&self) -> usize;

    /// Rows that see.
    fn n_queries(&self) -> usize;

    /// Rows that are seen.
    fn n_keys(&self) -> usize;

    /// The number of keys, from the first on, visible to query `q`: no fewer than for the query before it.
    fn visible(&self, q: usize) -> usize;

    /// The first query that sees key `k`.
    fn first_viewer(&self, k: usize) -> usize;

    /// 1 / √head_dim.
    #[inline(always)]
    fn scale(&self) -> f32 {
        (1.0 / (self.head_dim() as f64).sqrt()) as f32
    }

    /// Queries of the tile that starts at `first`.
    #[inline(always)]
    fn rows<L: Lanes>(&self, first: usize) -> Range<usize> {
        first..(first + tile_rows::<L>()).min(self.n_queries())
    }

    /// The number of keys visible to each; rows after the last repeat it.
    #[inline(always)]
    fn visible_by_row<L: Lanes>(&self, first: usize) -> [usize; ROWS] {
        let (last, mut by_row) = (self.rows::<L>(first).end - 1, [0; ROWS]);
        for (r, visible) in by_row.iter_mut().enumerate().take(tile_rows::<L>()) {
            *visible = self.visible((first + r).min(last));
        }
        by_row
    }
}

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
    fn is_whole(self) -> bool {
        self.columns.is_multiple_of(LANES)
    }

    /// Vectors of a row.
    #[inline(always)]
    fn vectors(self) -> usize {
        self.columns.div_ceil(LANES)
    }

    /// Where the first of `rows` starts. Checks that all of them lie within `values`, and that the angles are for heads of
    /// as many columns.
    #[inline(always)]
    fn first(self, values: &[f32], rows: &Range<usize>, angles: Option<Angles<'_>>) -> usize {
        let end = self.start + (rows.end.max(1) - 1) * self.stride + self.columns;
        assert!(rows.is_empty() || end <= values.len(), "rows of a head end beyond their matrix");
        let is_like = |angles: Angles<'_>| angles.rope.head_dim() == self.columns;
        assert!(angles.is_none_or(is_like), "angles are for heads of another width");
        self.start + rows.start * self.stride
    }
}

/// The angles of the positions of a sequence.
#[derive(Clone, Copy)]
pub struct Angles<'a> {
    pub rope: &'a Rope,
    /// Places among the angles; `None` for the positions themselves.
    pub listed: Option<&'a [u32]>,
}

impl Angles<'_> {
    /// The row of position `t` of both factors; see [`Rope::at`].
    #[inline(always)]
    fn at(self, t: usize) -> (*const f32, *const f32) {
        let (along, across) = self.rope.at(self.listed.map_or(t, |listed| listed[t] as usize));
        (along.as_ptr(), across.as_ptr())
    }
}

/// Rotates the pairs of the rows `rows`, if they have angles, and multiplies them by `scale`, into the first rows of
/// `to`.
#[inline(always)]
pub fn rotate<L: Lanes>(
    to: &mut Scratch,
    from: (&[f32], HeadRows),
    rows: Range<usize>,
    angles: Option<Angles<'_>>,
    scale: f32,
) {
    if from.1.is_whole() {
        rotate_as::<L, true>(to, from, rows, angles, scale);
    } else {
        rotate_as::<L, false>(to, from, rows, angles, scale);
    }
}

#[inline(always)]
fn rotate_as<L: Lanes, const WHOLE: bool>(
    to: &mut Scratch,
    (values, place): (&[f32], HeadRows),
    rows: Range<usize>,
    angles: Option<Angles<'_>>,
    scale: f32,
) {
    let first = place.first(values, &rows, angles);
    let (mut from, end) = (values.as_ptr().wrapping_add(first), values.as_ptr_range().end);
    let (mut to, stride) = to.memory_mut(rows.len(), place.columns);
    for t in rows {
        let angles = angles.map(|angles| angles.at(t));
        for j in (0..place.vectors()).map(|v| v * LANES) {
            // SAFETY: `first` and `memory_mut` have checked, and rows of angles are whole vectors.
            unsafe {
                let mut x = read::<L, WHOLE>(from.add(j), end);
                if let Some((along, across)) = angles {
                    x = turn(x, L::load(&*along.add(j).cast()), L::load(&*across.add(j).cast()));
                }
                x.mul(L::splat(scale)).store(&mut *to.add(j).cast());
            }
        }
        (from, to) = (from.wrapping_add(place.stride), to.wrapping_add(stride));
    }
}

/// The vector at `at`; with zeros after `end`, which comes first only if rows are not `WHOLE` vectors.
///
/// # Safety
///
/// `at` must lie in memory that ends at `end`, with a vector there if rows are `WHOLE` vectors.
#[inline(always)]
unsafe fn read<L: Lanes, const WHOLE: bool>(at: *const f32, end: *const f32) -> L {
    // SAFETY: the caller's promise.
    unsafe {
        if WHOLE || at.wrapping_add(LANES) <= end {
            L::load(&*at.cast())
        } else {
            L::read(slice::from_raw_parts(at, end.offset_from_unsigned(at)))
        }
    }
}

/// Turns the gradients by rotated vectors, the first rows of `from`, back, by the opposite angle, where
/// they have angles, and multiplies them by `scale`.
#[inline(always)]
pub fn rotate_back<L: Lanes>(
    to: (&mut [f32], HeadRows),
    from: &Scratch,
    rows: Range<usize>,
    angles: Option<Angles<'_>>,
    scale: f32,
) {
    if to.1.is_whole() {
        rotate_back_as::<L, true>(to, from, rows, angles, scale);
    } else {
        rotate_back_as::<L, false>(to, from, rows, angles, scale);
    }
}

#[inline(always)]
fn rotate_back_as<L: Lanes, const WHOLE: bool>(
    (values, place): (&mut [f32], HeadRows),
    from: &Scratch,
    rows: Range<usize>,
    angles: Option<Angles<'_>>,
    scale: f32,
) {
    let first = place.first(values, &rows, angles);
    let mut to = values.as_mut_ptr().wrapping_add(first);
    let (mut from, stride) = from.memory(rows.len(), place.columns);
    for t in rows {
        let angles = angles.map(|angles| angles.at(t));
        for j in (0..place.vectors()).map(|v| v * LANES) {
            // SAFETY: `first` and `memory` have checked, and rows of angles are whole vectors.
            unsafe {
                let mut x = L::load(&*from.add(j).cast());
                if let Some((along, across)) = angles {
                    let back = L::splat(0.0).sub(L::load(&*across.add(j).cast()));
                    x = turn(x, L::load(&*along.add(j).cast()), back);
                }
                let n = if WHOLE { LANES } else { LANES.min(place.columns - j) };
                x.mul(L::splat(scale)).write(slice::from_raw_parts_mut(to.add(j), n));
            }
        }
        (from, to) = (from.wrapping_add(stride), to.wrapping_add(place.stride));
    }
}

#[inline(always)]
fn turn<L: Lanes>(x: L, along: L, across: L) -> L {
    x.swap_pairs().mul_add(across, x.mul(along))
}
