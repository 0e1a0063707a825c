//! The features that follow from the root and the positions of the joints.

use super::features::{POSITIONS, ROOT_YAW, features_with_headings};
use super::recover::recover_joints;
use super::rotation::Yaw;
use crate::motion::N_FEATURES;

/// All features of a motion of which the root and the joints' positions are known: these as they are,
/// and rotations, velocities and contacts of the poses that they describe. Where the last frame leads,
/// the body is as in that frame.
///
/// # Shapes
/// Row-major `[T, 67]`, not normalised, to `[T, 263]`.
///
/// # Panics
/// If `known` does not consist of whole rows.
pub fn complete_features(known: &[f32]) -> Vec<f32> {
    let width = POSITIONS.end;
    assert!(known.len().is_multiple_of(width), "the known features come in rows of {width}");
    let last = known.len().saturating_sub(width);
    let mut rows = Vec::with_capacity(known.len() / width * N_FEATURES + N_FEATURES);
    for row in known.chunks_exact(width).chain([&known[last..]]) {
        rows.extend_from_slice(row);
        rows.resize(rows.len() + N_FEATURES - row.len(), 0.0);
    }
    let turns = rows.chunks_exact(N_FEATURES).scan(0.0, |half_angle, row| {
        let heading = Yaw::from_half_angle(*half_angle);
        *half_angle += f64::from(row[ROOT_YAW]);
        Some(heading)
    });
    let headings: Vec<Yaw> = turns.collect();
    let mut features = features_with_headings(&recover_joints(&rows), &headings);
    for (row, known) in features.chunks_exact_mut(N_FEATURES).zip(known.chunks_exact(width)) {
        row[..width].copy_from_slice(known);
    }
    features
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::build_features;
    use crate::motion::features::{CONTACTS, VELOCITIES};
    use crate::motion::fixtures::{dance, largest_difference};

    #[test]
    fn what_follows_from_the_positions_comes_back() {
        let features = build_features(&dance(40));
        let known: Vec<f32> =
            features.chunks_exact(N_FEATURES).flat_map(|row| &row[..67]).copied().collect();
        let found = complete_features(&known);
        assert_eq!(found.len(), features.len());
        // Where the last frame leads, its pose is not known.
        let before_last = features.len() - N_FEATURES;
        let off = largest_difference(&found[..before_last], &features[..before_last]);
        assert!(off < 1e-3, "{off}");
        let last = |x: &[f32]| x[before_last..][..VELOCITIES.start].to_vec();
        assert!(largest_difference(&last(&found), &last(&features)) < 1e-3);
        assert!(found[before_last..][CONTACTS].iter().all(|x| [0.0, 1.0].contains(x)));
    }

    #[test]
    fn no_frames_stay_none() {
        assert_eq!(complete_features(&[]), Vec::<f32>::new());
    }
}
