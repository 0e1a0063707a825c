//! How far one motion is from another.

use super::skeleton::{N_JOINTS, Pose};

/// Mean distance in millimetres between the joints of two motions, pelvis on pelvis in each frame.
///
/// `1000 / (T J) Σ_t Σ_j ‖(p_tj − p_t0) − (p̂_tj − p̂_t0)‖`, the pelvis, whose distance is zero,
/// counted among the J = 22 joints. Where a body stands and which way it travels plays no part,
/// which way it faces does.
///
/// # Panics
/// If the motions differ in length or hold no frame.
pub fn mpjpe_mm(truth: &[Pose], prediction: &[Pose]) -> f64 {
    assert_eq!(truth.len(), prediction.len(), "both motions have the same frames");
    assert!(!truth.is_empty(), "a motion without frames has no error");
    let metres: f64 = truth.iter().zip(prediction).map(|(a, b)| aligned_distance_m(a, b)).sum();
    1000.0 * metres / (truth.len() * N_JOINTS) as f64
}

/// Sum over joints of the distance between two poses with their pelvises on one point.
fn aligned_distance_m(a: &Pose, b: &Pose) -> f64 {
    let relative =
        |pose: &Pose, joint: usize, c: usize| f64::from(pose[joint][c]) - f64::from(pose[0][c]);
    (0..N_JOINTS)
        .map(|joint| {
            let square = |c: usize| (relative(a, joint, c) - relative(b, joint, c)).powi(2);
            (0..3).map(square).sum::<f64>().sqrt()
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::fixtures::{dance, moved};

    #[test]
    fn a_moved_body_has_no_error_and_a_moved_wrist_counts_for_one_joint() {
        let poses = dance(10);
        assert!(mpjpe_mm(&poses, &moved(&poses, 0.0, [1.0, 2.0, 3.0])) < 1e-3);
        let mut bent = poses.clone();
        bent.iter_mut().for_each(|pose| pose[21][1] += 0.022);
        assert!((mpjpe_mm(&poses, &bent) - 1.0).abs() < 1e-4);
    }
}
