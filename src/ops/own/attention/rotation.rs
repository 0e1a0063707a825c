//! Turning queries and keys by their positions, and their gradients back; see [`Rope`].
//!
//! [`Rope`]: crate::ops::Rope

use crate::ops::own::product::Scratch;

/// Turns the pairs of `source`, leaving those of even index in the first half.
#[inline(always)]
pub fn rotate(target: &mut [f32], source: &[f32], (cos, sin): (&[f32], &[f32]), scale: f32) {
    let (even, odd) = target.split_at_mut(cos.len());
    let angles = cos.iter().zip(sin);
    let pairs = source.as_chunks().0.iter().zip(angles);
    for ((even, odd), (&[a, b], (cos, sin))) in even.iter_mut().zip(odd).zip(pairs) {
        *even = (a * cos - b * sin) * scale;
        *odd = (a * sin + b * cos) * scale;
    }
}

/// As [`rotate`], into column `t` of a transposed matrix.
#[inline(always)]
pub fn rotate_into_column(
    target: &mut Scratch,
    t: usize,
    source: &[f32],
    angles: (&[f32], &[f32]),
) {
    let (cos, sin) = angles;
    let pairs = source.as_chunks().0.iter().zip(cos.iter().zip(sin));
    for (i, (&[a, b], (cos, sin))) in pairs.enumerate() {
        target.set(i, t, a * cos - b * sin);
        target.set(angles.0.len() + i, t, a * sin + b * cos);
    }
}

/// Turns the gradient by a rotated vector back: [`rotate`] by the opposite angle.
#[inline(always)]
pub fn rotate_back(target: &mut [f32], source: &[f32], (cos, sin): (&[f32], &[f32]), scale: f32) {
    let (even, odd) = source.split_at(cos.len());
    let angles = cos.iter().zip(sin);
    let pairs = target.as_chunks_mut().0.iter_mut().zip(angles);
    for ((even, odd), ([a, b], (cos, sin))) in even.iter().zip(odd).zip(pairs) {
        *a = (even * cos + odd * sin) * scale;
        *b = (odd * cos - even * sin) * scale;
    }
}
