//! Rows of one head on their way to a [`Scratch`], queries and keys turned by their positions, and back;
//! see [`Rope`].

use std::ops::Range;

use super::head_rows::{HeadRows, read, write};
use crate::ops::Rope;
use crate::ops::own::lanes::{LANES, Lanes};
use crate::ops::own::scratch::Scratch;

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

/// Turns the pairs of the rows `rows`, where they have angles, and multiplies them by `scale`, into the
/// first rows of `to`.
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
        let (to, from) = (to.row_mut(i), place.row(values, t));
        let angles = angles.map(|angles| angles.at(t));
        for j in (0..place.columns).step_by(LANES) {
            let mut x = read::<L, WHOLE>(from, j);
            if let Some((along, across)) = angles {
                x = turn(x, read::<L, WHOLE>(along, j), read::<L, WHOLE>(across, j));
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
                let across = L::splat(0.0).sub(read::<L, WHOLE>(across, j));
                x = turn(x, read::<L, WHOLE>(along, j), across);
            }
            write::<L, WHOLE>(to, j, x.mul(L::splat(scale)));
        }
    }
}

#[inline(always)]
fn turn<L: Lanes>(x: L, along: L, across: L) -> L {
    x.swap_pairs().mul_add(across, x.mul(along))
}
