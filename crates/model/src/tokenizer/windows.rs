//! The input of a training step: [`Windows`], and bodies mixed from several clips.

use std::ops::Range;

use rand_chacha::ChaCha8Rng;

use crate::draws::{below, unit};
use crate::motion::{POSITIONS, ROTATIONS, VELOCITIES};

/// Windows of one length.
#[derive(Clone, Debug, PartialEq)]
pub struct Windows {
    /// Normalised, row-major `[n, n_frames, f]`; beyond the end of a clip, its last frame.
    pub values: Vec<f32>,
    /// Whether a frame is one of the clip's own, `[n, n_frames]`.
    pub visible: Vec<bool>,
    pub n_frames: usize,
    /// The clip of the training split that each window was cut from, or whose mirror image was.
    pub clips: Vec<usize>,
}

impl Windows {
    /// The number of windows.
    pub fn len(&self) -> usize {
        self.visible.len() / self.n_frames
    }

    /// Frames that are a clip's own.
    pub fn n_visible(&self) -> usize {
        self.visible.iter().filter(|visible| **visible).count()
    }
}

// The upper body, or an arm, of another window: a few hours of motion have few combinations of leg and arm movements; a
// tokenizer trained on mixed parts generalises better.

/// A part of the body, and its parent joint.
struct Part {
    joints: &'static [usize],
    /// 0 is the root.
    hangs_from: usize,
}

const UPPER_BODY: Part =
    Part { joints: &[3, 6, 9, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21], hangs_from: 0 };
const LEFT_ARM: Part = Part { joints: &[13, 16, 18, 20], hangs_from: 9 };
const RIGHT_ARM: Part = Part { joints: &[14, 17, 19, 21], hangs_from: 9 };

/// Columns of a joint's position; the root has none.
fn position(joint: usize) -> Range<usize> {
    let start = POSITIONS.start + 3 * (joint - 1);
    start..start + 3
}

/// Columns of a joint's velocity.
fn velocity(joint: usize) -> Range<usize> {
    let start = VELOCITIES.start + 3 * joint;
    start..start + 3
}

/// Columns of a joint's rotation.
fn rotation(joint: usize) -> Range<usize> {
    let start = ROTATIONS.start + 6 * (joint - 1);
    start..start + 6
}

/// Probabilities of mixing.
#[derive(Clone, Copy, Debug)]
pub struct Mixing {
    /// Chance of another window's upper body.
    pub body: f64,
    /// Chance of another window's arm, for each arm.
    pub arm: f64,
}

impl Mixing {
    /// Gives some windows parts of others. `std` are the deviations that values were divided by.
    pub fn apply(self, windows: &mut Windows, std: &[f32], rng: &mut ChaCha8Rng) {
        let parts = [(UPPER_BODY, self.body), (LEFT_ARM, self.arm), (RIGHT_ARM, self.arm)];
        for (part, chance) in parts.into_iter().filter(|(_, chance)| *chance > 0.0) {
            let others = permutation(windows.len(), rng);
            let before = windows.clone();
            let (frames, size) = (windows.n_frames, windows.n_frames * std.len());
            for (window, other) in others.into_iter().enumerate() {
                if unit(rng) >= chance {
                    continue;
                }
                let to = windows.values[window * size..][..size].chunks_exact_mut(std.len());
                let from = before.values[other * size..][..size].chunks_exact(std.len());
                to.zip(from).for_each(|(to, from)| part.graft(to, from, std));
                let visible = &mut windows.visible[window * frames..][..frames];
                let of_other = &before.visible[other * frames..][..frames];
                visible.iter_mut().zip(of_other).for_each(|(visible, other)| *visible &= other);
            }
        }
    }
}

fn permutation(n: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, below(rng, i + 1));
    }
    order
}

impl Part {
    /// Copies the part of one frame onto another: its rotations, and its positions and velocities relative to the parent
    /// joint; without rotations and velocities only its positions.
    fn graft(&self, to: &mut [f32], from: &[f32], std: &[f32]) {
        let place = (self.hangs_from > 0).then(|| offset(to, from, std, position(self.hangs_from)));
        for &joint in self.joints {
            moved(to, from, std, position(joint), place.unwrap_or_default());
        }
        if std.len() < VELOCITIES.end {
            return;
        }
        let motion = offset(to, from, std, velocity(self.hangs_from));
        for &joint in self.joints {
            to[rotation(joint)].copy_from_slice(&from[rotation(joint)]);
            moved(to, from, std, velocity(joint), motion);
        }
    }
}

/// Distance of a joint between two frames, in the unit of its features.
fn offset(to: &[f32], from: &[f32], std: &[f32], columns: Range<usize>) -> [f32; 3] {
    std::array::from_fn(|i| {
        let column = columns.start + i;
        (to[column] - from[column]) * std[column]
    })
}

fn moved(to: &mut [f32], from: &[f32], std: &[f32], columns: Range<usize>, by: [f32; 3]) {
    for (column, by) in columns.zip(by) {
        to[column] = from[column] + by / std[column];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_FEATURES;
    use rand_chacha::rand_core::SeedableRng;

    fn frame(phase: f32) -> Vec<f32> {
        (0..N_FEATURES).map(|i| (i as f32 + phase).sin()).collect()
    }

    #[test]
    fn an_arm_keeps_its_shape_and_hangs_from_the_other_chest() {
        let std: Vec<f32> = (0..N_FEATURES).map(|i| 0.5 + (i % 3) as f32).collect();
        let (mut to, from) = (frame(0.0), frame(9.0));
        let chest = to[position(9)].to_vec();
        LEFT_ARM.graft(&mut to, &from, &std);
        assert_eq!(to[position(9)], chest);
        assert_eq!(to[position(14)], frame(0.0)[position(14)], "the right arm stays");
        assert_eq!(to[rotation(20)], from[rotation(20)]);
        for i in 0..3 {
            let metres = |frame: &[f32], joint: usize| {
                let column = position(joint).start + i;
                frame[column] * std[column]
            };
            let about = |frame: &[f32]| metres(frame, 20) - metres(frame, 9);
            assert!((about(&to) - about(&from)).abs() < 1e-5);
        }
    }

    #[test]
    fn a_mixed_window_is_visible_where_both_are() {
        let values: Vec<f32> = [frame(0.0), frame(1.0), frame(2.0), frame(3.0)].concat();
        let visible = vec![true, true, true, false];
        let mut windows = Windows { values, visible, n_frames: 2, clips: vec![0, 1] };
        let before = windows.clone();
        let mixing = Mixing { body: 1.0, arm: 0.0 };
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        while permutation(2, &mut rng.clone()) != [1, 0] {
            rng.set_word_pos(rng.get_word_pos() + 2);
        }
        mixing.apply(&mut windows, &[1.0; N_FEATURES], &mut rng);
        assert_eq!(windows.visible, [true, false, true, false]);
        assert_eq!(windows.values[position(1)], before.values[position(1)], "legs stay");
        let upper = N_FEATURES * 2 + position(3).start;
        assert_eq!(windows.values[position(3).start], before.values[upper]);
    }
}
