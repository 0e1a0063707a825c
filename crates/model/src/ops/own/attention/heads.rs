//! One head of one sequence: its mask, its rows in the matrices of all heads, and copies to a [`Scratch`] and back, with
//! queries and keys rotated by their positions; see [`Rope`].

use std::ops::Range;

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
        for (r, visible) in by_row.iter_mut().enumerate() {
            *visible = self.visible((first + r).min(last));
        }
        by_row
    }

    /// Most keys visible in the tile that starts at `first`: those of its last query.
    #[inline(always)]
    fn visible_in_tile<L: Lanes>(&self, first: usize) -> usize {
        self.visible(self.rows::<L>(first).end - 1)
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

    /// Row `t`, and if it is not `WHOLE` vectors all that comes after it, so that vectors are read whole.
    #[inline(always)]
    fn row<const WHOLE: bool>(self, values: &[f32], t: usize) -> &[f32] {
        let row = &values[self.start + t * self.stride..];
        if WHOLE { &row[..self.columns] } else { row }
    }

    /// Row `t`.
    #[inline(always)]
    fn row_mut(self, values: &mut [f32], t: usize) -> &mut [f32] {
        &mut values[self.start + t * self.stride..][..self.columns]
    }
}

/// The vector of a row from column `j` on; with zeros after the end of `row`, if that comes first.
#[inline(always)]
fn read<L: Lanes, const WHOLE: bool>(row: &[f32], j: usize) -> L {
    L::read(&row[j..end::<WHOLE>(row, j)])
}

/// Writes a vector to a row from column `j` on, or as much of the vector as there are columns.
#[inline(always)]
fn write<L: Lanes, const WHOLE: bool>(row: &mut [f32], j: usize, vector: L) {
    let end = end::<WHOLE>(row, j);
    vector.write(&mut row[j..end]);
}

#[inline(always)]
fn end<const WHOLE: bool>(row: &[f32], j: usize) -> usize {
    if WHOLE { j + LANES } else { row.len().min(j + LANES) }
}

/// The angles of the positions of a sequence.
#[derive(Clone, Copy)]
pub struct Angles<'a> {
    pub rope: &'a Rope,
    /// Places among the angles; `None` for the positions themselves.
    pub listed: Option<&'a [u32]>,
}

impl<'a> Angles<'a> {
    #[inline(always)]
    fn at(self, t: usize) -> (&'a [f32], &'a [f32]) {
        self.rope.at(self.listed.map_or(t, |listed| listed[t] as usize))
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
    for (i, t) in rows.enumerate() {
        let (to, from) = (to.row_mut(i), place.row::<WHOLE>(values, t));
        let angles = angles.map(|angles| angles.at(t));
        for j in (0..place.columns).step_by(LANES) {
            let mut x = read::<L, WHOLE>(from, j);
            if let Some((along, across)) = angles {
                x = turn(x, read::<L, true>(along, j), read::<L, true>(across, j));
            }
            write::<L, true>(to, j, x.mul(L::splat(scale)));
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
    for (i, t) in rows.enumerate() {
        let (to, from) = (place.row_mut(values, t), from.row(i));
        let angles = angles.map(|angles| angles.at(t));
        for j in (0..place.columns).step_by(LANES) {
            let mut x = read::<L, true>(from, j);
            if let Some((along, across)) = angles {
                let across = L::splat(0.0).sub(read::<L, true>(across, j));
                x = turn(x, read::<L, true>(along, j), across);
            }
            write::<L, WHOLE>(to, j, x.mul(L::splat(scale)));
        }
    }
}

#[inline(always)]
fn turn<L: Lanes>(x: L, along: L, across: L) -> L {
    x.swap_pairs().mul_add(across, x.mul(along))
}
