//! Long motions into clips.

use std::ops::Range;

use crate::motion::Pose;

/// Poses of the shortest clip that a data set takes: 40 frames of features.
pub const SHORTEST: usize = 41;
/// Poses of the longest clip that stays whole: 199 frames of features.
const LONGEST: usize = 200;
/// Poses of the longest part of a motion that is cut.
const WINDOW: usize = 196;
/// Poses on either side of an even division among which the calmest is looked for.
const NEAR: usize = 20;

/// The clips of a motion: all of it up to 200 poses; of a longer one even parts of at most 196, parted where
/// the body is calmest near the even division. Parts too short for a clip do not come about.
pub fn cuts(poses: &[Pose]) -> Vec<Range<usize>> {
    let n = poses.len();
    if n <= LONGEST {
        return std::iter::once(0..n).collect();
    }
    let parts = n.div_ceil(WINDOW);
    let mut cuts = Vec::with_capacity(parts);
    let mut first = 0;
    for part in 1..parts {
        let even = n * part / parts;
        // What is left must still fit into the parts that are left.
        let least = even.saturating_sub(NEAR).max(n.saturating_sub(WINDOW * (parts - part)));
        let most = (even + NEAR).min(first + WINDOW);
        let at = (least..=most).min_by(|a, b| speed(poses, *a).total_cmp(&speed(poses, *b)));
        let at = at.unwrap_or(even);
        cuts.push(first..at);
        first = at;
    }
    cuts.push(first..n);
    cuts
}

/// The squares of the joints' steps to this pose.
fn speed(poses: &[Pose], at: usize) -> f32 {
    let [before, here] = [&poses[at - 1], &poses[at]].map(|pose| pose.as_flattened());
    before.iter().zip(here).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_JOINTS;

    /// Poses that move by a millimetre a frame, but for one at rest.
    fn poses(n: usize, rest: usize) -> Vec<Pose> {
        let mut x = 0.0;
        let place = |t: usize| {
            x += if t == rest { 0.0 } else { 0.001 };
            [[x, 0.0, 0.0]; N_JOINTS]
        };
        (0..n).map(place).collect()
    }

    #[test]
    fn motions_of_any_length_are_parted_without_a_gap() {
        for n in (41..1200).step_by(7) {
            let cuts = cuts(&poses(n, 0));
            let longest = if n <= LONGEST { LONGEST } else { WINDOW };
            assert_eq!((cuts[0].start, cuts[cuts.len() - 1].end), (0, n));
            assert!(cuts.windows(2).all(|pair| pair[0].end == pair[1].start), "{n}");
            assert!(
                cuts.iter().all(|cut| (SHORTEST..=longest).contains(&cut.len())),
                "{n}: {cuts:?}"
            );
        }
    }

    #[test]
    fn the_calmest_frame_near_the_middle_parts_a_motion() {
        assert_eq!(cuts(&poses(300, 141)), [0..141, 141..300]);
        assert_eq!(cuts(&poses(300, 90))[0].end.abs_diff(150), 20);
    }
}
