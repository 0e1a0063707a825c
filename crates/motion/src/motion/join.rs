//! [`joined`]: a part of one motion in another one's place.
//!
//! Features hold the root's steps, so a changed part would move all frames after it. Here the steps and turns of the part
//! are corrected, so that the frames after it stand where they stood.

use std::f64::consts::PI;
use std::ops::Range;

use super::N_FEATURES;
use super::features::{POSITIONS, ROOT_VELOCITY, ROOT_YAW, VELOCITIES};
use super::geometry::Yaw;
use super::recover::complete_features;

/// The weight of the other motion in each frame: 1 in the part, and outside of it half a cosine that reaches 0 after
/// `fade` frames.
pub fn join_weights(part: &[bool], fade: usize) -> Vec<f64> {
    let inside: Vec<usize> = (0..part.len()).filter(|&frame| part[frame]).collect();
    let weight = |frame: usize| {
        let after = inside.partition_point(|&other| other < frame);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let apart = near.filter_map(|i| inside.get(i)).map(|other| other.abs_diff(frame)).min();
        let apart = apart.filter(|apart| *apart <= fade)?;
        Some(0.5 + 0.5 * (PI * apart as f64 / (fade + 1) as f64).cos())
    };
    (0..part.len()).map(|frame| weight(frame).unwrap_or(0.0)).collect()
}

/// `kept` with `other` in its place wherever `weights` says so; frames of weight 0 keep their features.
///
/// Root and positions are the weighted mean of both. In each stretch of frames with a weight, which begins where
/// `kept` stands, the root's path is corrected so that it ends where that of `kept` does: the turn that is missing at
/// the end is added to the turns, and then the missing way to the steps, both in proportion to the weights. A stretch
/// that reaches the end of the motion ends where it will. Rotations, velocities and contacts of a stretch are computed
/// from its positions, at `fps` frames a second.
///
/// # Shapes
/// Row-major `[T, 263]` twice, not normalised, and `[T]` weights to `[T, 263]`.
///
/// # Panics
/// If the motions or the weights differ in length.
pub fn joined(kept: &[f32], other: &[f32], weights: &[f64], fps: f64) -> Vec<f32> {
    let lengths = [kept.len(), other.len()];
    assert_eq!(lengths, [weights.len() * N_FEATURES; 2], "motions of one length");
    let mut result = kept.to_vec();
    for stretch in stretches(weights) {
        let rows = stretch.start * N_FEATURES..stretch.end * N_FEATURES;
        let (own, weights) = (&mut result[rows.clone()], &weights[stretch.clone()]);
        mix(own, &other[rows.clone()], weights);
        if rows.end < kept.len() {
            close(own, &kept[rows], weights);
        }
    }
    complete_stretches(&mut result, weights, fps);
    result
}

/// Computes rotations, velocities and contacts of the frames with a weight again, from root and positions.
pub(super) fn complete_stretches(features: &mut [f32], weights: &[f64], fps: f64) {
    let known = features.chunks_exact(N_FEATURES).flat_map(|row| &row[..POSITIONS.end]);
    let complete = complete_features(&known.copied().collect::<Vec<f32>>(), fps);
    for Range { start, end } in stretches(weights) {
        // The frame before a stretch steps into it.
        let before = start.saturating_sub(1) * N_FEATURES + VELOCITIES.start;
        let from = if start == 0 { 0 } else { before };
        features[from..end * N_FEATURES].copy_from_slice(&complete[from..end * N_FEATURES]);
    }
}

/// The frames with a weight, in stretches without a gap.
fn stretches(weights: &[f64]) -> Vec<Range<usize>> {
    let mut from = 0;
    let runs = weights.chunk_by(|a, b| (*a > 0.0) == (*b > 0.0)).map(|run| {
        from += run.len();
        (run[0] > 0.0).then(|| from - run.len()..from)
    });
    runs.flatten().collect()
}

/// Root and positions of a stretch as the weighted mean of both motions.
fn mix(own: &mut [f32], other: &[f32], weights: &[f64]) {
    let rows = own.chunks_exact_mut(N_FEATURES).zip(other.chunks_exact(N_FEATURES));
    for ((own, other), &weight) in rows.zip(weights) {
        for (a, b) in own[..POSITIONS.end].iter_mut().zip(other) {
            *a = ((1.0 - weight) * f64::from(*a) + weight * f64::from(*b)) as f32;
        }
    }
}

/// Corrects the turns and steps of a stretch, so that it leads to where `kept` leads.
fn close(own: &mut [f32], kept: &[f32], weights: &[f64]) {
    let total: f64 = weights.iter().sum();
    let missing = headings(kept)[weights.len()] - headings(own)[weights.len()];
    // Half a turn of the half angle is a whole turn.
    let missing = missing - PI * (missing / PI).round();
    for (row, weight) in own.chunks_exact_mut(N_FEATURES).zip(weights) {
        row[ROOT_YAW] += (missing * weight / total) as f32;
    }
    let ([x, z], [kept_x, kept_z]) = (way(own), way(kept));
    let headings = headings(own);
    for (t, row) in own.chunks_exact_mut(N_FEATURES).enumerate() {
        let share = weights[t] / total;
        let turned = Yaw::from_half_angle(headings[t + 1]);
        let step = turned.rotate_xz((kept_x - x) * share, (kept_z - z) * share);
        for (velocity, added) in row[ROOT_VELOCITY].iter_mut().zip([step.0, step.1]) {
            *velocity += added as f32;
        }
    }
}

/// Half angles of the root in each frame of some rows and where they lead, from that of the first.
///
/// # Shapes
/// `[T, 263]` row-major to `[T + 1]`.
pub(super) fn headings(rows: &[f32]) -> Vec<f64> {
    let turns = rows.chunks_exact(N_FEATURES).scan(0.0, |sum, row| {
        *sum += f64::from(row[ROOT_YAW]);
        Some(*sum)
    });
    std::iter::once(0.0).chain(turns).collect()
}

/// The way of the root over some rows, seen from the body of the first: x and z in metres.
fn way(rows: &[f32]) -> [f64; 2] {
    let steps = rows.chunks_exact(N_FEATURES).zip(headings(rows).into_iter().skip(1));
    steps.fold([0.0; 2], |[x, z], (row, half_angle)| {
        let [right, ahead] = [ROOT_VELOCITY.start, ROOT_VELOCITY.start + 1].map(|i| row[i]);
        let back = Yaw::from_half_angle(half_angle).inverse();
        let step = back.rotate_xz(f64::from(right), f64::from(ahead));
        [x + step.0, z + step.1]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::fixtures::procedural;
    use crate::motion::{build_features, mpjpe_mm, recover_joints};

    const N: usize = 100;
    const FADE: usize = 10;

    /// Two motions of 100 frames, and a part.
    fn two() -> [Vec<f32>; 2] {
        [3, 8].map(|seed| build_features(&procedural(seed))[..N * N_FEATURES].to_vec())
    }

    fn part(frames: Range<usize>) -> Vec<bool> {
        (0..N).map(|frame| frames.contains(&frame)).collect()
    }

    /// The largest distance of a joint in metres between frames of two motions, each at its own place.
    fn apart(a: &[f32], b: &[f32], frames: impl Iterator<Item = usize>) -> f32 {
        let (a, b) = (recover_joints(a), recover_joints(b));
        let distance = |frame: usize| {
            let joints = a[frame].iter().zip(&b[frame]);
            joints.map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f32>().sqrt())
        };
        frames.flat_map(|frame| distance(frame).collect::<Vec<_>>()).fold(0.0, f32::max)
    }

    #[test]
    fn frames_outside_of_the_fade_stand_where_they_stood_to_a_hundredth_of_a_millimetre() {
        let [kept, other] = two();
        for frames in [30..60, 0..40, 45..46] {
            let weights = join_weights(&part(frames.clone()), FADE);
            let made = joined(&kept, &other, &weights, 20.0);
            let outside = (0..N).filter(|&t| t + FADE < frames.start || t >= frames.end + FADE);
            let off = apart(&made, &kept, outside);
            assert!(off < 1e-5, "{frames:?}: {off} m");
            assert!(apart(&made, &kept, frames) > 0.05, "the part is another");
        }
    }

    #[test]
    fn a_part_has_the_poses_of_the_other_motion() {
        let [kept, other] = two();
        let made = joined(&kept, &other, &join_weights(&part(30..60), FADE), 20.0);
        let poses = |features: &[f32]| {
            let mut rows = features[30 * N_FEATURES..60 * N_FEATURES].to_vec();
            rows.chunks_exact_mut(N_FEATURES).for_each(|row| row[..ROOT_VELOCITY.end].fill(0.0));
            recover_joints(&rows)
        };
        assert_eq!(mpjpe_mm(&poses(&made), &poses(&other)), 0.0);
    }

    #[test]
    fn neither_the_root_nor_a_joint_jumps_where_motions_are_joined() {
        let [kept, other] = two();
        let largest_step = |features: &[f32]| {
            let poses = recover_joints(features);
            let steps = poses.windows(2).flat_map(|pair| {
                let pair = [pair[0], pair[1]];
                (0..22).map(move |j| {
                    (0..3).map(|c| (pair[1][j][c] - pair[0][j][c]).powi(2)).sum::<f32>().sqrt()
                })
            });
            steps.fold(0.0, f32::max)
        };
        let made = joined(&kept, &other, &join_weights(&part(30..60), FADE), 20.0);
        let most = largest_step(&kept).max(largest_step(&other));
        assert!(largest_step(&made) < 1.5 * most, "{} {most}", largest_step(&made));
    }

    #[test]
    fn what_follows_from_positions_follows_in_a_stretch_and_stays_elsewhere() {
        let [kept, other] = two();
        let made = joined(&kept, &other, &join_weights(&part(30..60), FADE), 20.0);
        assert_eq!(made[..19 * N_FEATURES], kept[..19 * N_FEATURES]);
        assert_eq!(made[70 * N_FEATURES..], kept[70 * N_FEATURES..]);
        let known = made.chunks_exact(N_FEATURES).flat_map(|row| row[..67].to_vec());
        let all = complete_features(&known.collect::<Vec<_>>(), 20.0);
        assert_eq!(made[20 * N_FEATURES..70 * N_FEATURES], all[20 * N_FEATURES..70 * N_FEATURES]);
    }

    #[test]
    fn a_motion_is_itself_without_a_part_and_the_other_where_all_is_one() {
        let [kept, other] = two();
        assert_eq!(joined(&kept, &other, &join_weights(&part(0..0), FADE), 20.0), kept);
        let whole = joined(&kept, &other, &join_weights(&part(0..N), FADE), 20.0);
        assert!(apart(&whole, &other, 0..N) == 0.0);
        let twice = joined(&kept, &kept, &join_weights(&part(30..60), FADE), 20.0);
        assert!(apart(&twice, &kept, 0..N) < 1e-5);
    }

    #[test]
    fn weights_fall_by_half_a_cosine() {
        let weights = join_weights(&part(30..60), 3);
        let half = 0.5f64.sqrt() / 2.0;
        let expected = [0.0, 0.5 - half, 0.5, 0.5 + half, 1.0];
        for (i, expected) in expected.into_iter().enumerate() {
            assert!((weights[26 + i] - expected).abs() < 1e-12, "{i}");
            assert!((weights[63 - i] - expected).abs() < 1e-12, "{i}");
        }
        let both = join_weights(&[true, false, false, true], 1);
        assert_eq!(both, [1.0, 0.5, 0.5, 1.0]);
        assert_eq!(join_weights(&part(30..60), 0)[29..31], [0.0, 1.0]);
    }
}
