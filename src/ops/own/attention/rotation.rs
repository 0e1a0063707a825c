//! Turning queries and keys by their positions, and their gradients back; see [`Rope`].
//!
//! [`Rope`]: crate::ops::Rope

use crate::ops::own::lanes::{LANES, Lanes};

/// Turns the pairs of `source`, and multiplies them by `scale`.
#[inline(always)]
pub fn rotate<L: Lanes>(target: &mut [f32], source: &[f32], angles: (&[f32], &[f32]), scale: f32) {
    turn::<L, false>(target, source, angles, scale);
}

/// Turns the gradient by a rotated vector back: [`rotate`] by the opposite angle.
#[inline(always)]
pub fn rotate_back<L: Lanes>(
    target: &mut [f32],
    source: &[f32],
    angles: (&[f32], &[f32]),
    scale: f32,
) {
    turn::<L, true>(target, source, angles, scale);
}

#[inline(always)]
fn turn<L: Lanes, const BACK: bool>(
    target: &mut [f32],
    source: &[f32],
    (along, across): (&[f32], &[f32]),
    scale: f32,
) {
    let angles = along.chunks(LANES).zip(across.chunks(LANES));
    let vectors = target.chunks_mut(LANES).zip(source.chunks(LANES));
    for ((target, source), (along, across)) in vectors.zip(angles) {
        let (x, across) = (L::read(source), L::read(across));
        let across = if BACK { L::splat(0.0).sub(across) } else { across };
        let turned = x.swap_pairs().mul_add(across, x.mul(L::read(along)));
        turned.mul(L::splat(scale)).write(target);
    }
}
