//! Where a body faces: the direction of the first frame, and the smoothed heading of the root.

use super::geometry::{Yaw, norm};
use super::skeleton::{L_HIP, L_SHOULDER, Pose, R_HIP, R_SHOULDER};

/// Deviation in seconds of the Gaussian that smooths the heading.
const SIGMA_S: f64 = 1.0;
/// Deviations on either side that the Gaussian sees.
const SEEN: f64 = 4.0;

/// The turn that makes the body of `pose` face +z.
///
/// The body faces along `up × across`, where `across` leads from the left hip and shoulder to the
/// right ones. A pose in which that vector is vertical or zero faces nowhere and is not turned.
pub fn facing_turn(pose: &Pose) -> Yaw {
    forward(pose, [L_HIP, R_HIP]).and_then(|[x, z]| Yaw::to_face_z(x, z)).unwrap_or(Yaw::IDENTITY)
}

/// The root's rotation in each frame, from the smoothed heading; the first is the identity.
///
/// HumanML3D's inverse kinematics names the hips the other way round than its shoulders, so that
/// the hips' vector is *subtracted* from the shoulders'. All its files are made so, and we follow.
/// The quaternions' signs are chosen so that neighbours lie in one half-space: a step of feature 0
/// is then never taken the long way round. A frame that faces nowhere keeps the heading before it.
pub fn root_headings(poses: &[Pose], fps: f64) -> Vec<Yaw> {
    let (x, z) = (poses.iter())
        .scan([0.0, 1.0], |last, pose| {
            *last = forward(pose, [R_HIP, L_HIP]).unwrap_or(*last);
            Some((last[0], last[1]))
        })
        .unzip();
    let weights = gaussian(SIGMA_S * fps);
    let (x, z): (Vec<f64>, Vec<f64>) = (smoothed(x, &weights), smoothed(z, &weights));
    (x.iter().zip(&z).enumerate())
        .scan(Yaw::IDENTITY, |last, (t, (&x, &z))| {
            let yaw = if t == 0 { None } else { Yaw::to_face_z(x, z) }.unwrap_or(*last);
            *last = if yaw.dot(*last) < 0.0 { yaw.negated() } else { yaw };
            Some(*last)
        })
        .collect()
}

/// Horizontal part `[x, z]` of `up × across` for the unit vector `across`; shorter than 1 where
/// the body leans sideways.
fn forward(pose: &Pose, [hip_from, hip_to]: [usize; 2]) -> Option<[f64; 2]> {
    let across: [f64; 3] = std::array::from_fn(|c| {
        let at = |joint: usize| f64::from(pose[joint][c]);
        at(hip_to) - at(hip_from) + at(R_SHOULDER) - at(L_SHOULDER)
    });
    let length = norm(across);
    (length > 0.0).then(|| [across[2] / length, -across[0] / length])
}

/// `values` under the Gaussian, with the first and the last value repeated beyond the ends.
fn smoothed(values: Vec<f64>, gaussian: &[f64]) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (values.first(), values.last()) else { return values };
    let beyond = gaussian.len() / 2;
    let padded = [vec![first; beyond], values.clone(), vec![last; beyond]].concat();
    let mut sums = vec![0.0; values.len()];
    // Weight by weight, not value by value: the inner loop then has no sum to carry.
    for (k, weight) in gaussian.iter().enumerate() {
        for (sum, value) in sums.iter_mut().zip(&padded[k..]) {
            *sum += weight * value;
        }
    }
    sums
}

/// Weights of the Gaussian with a deviation of so many frames, with sum 1; an odd number.
fn gaussian(sigma: f64) -> Vec<f64> {
    let radius = (SEEN * sigma).round();
    let weight = |k: usize| (-0.5 * ((k as f64 - radius) / sigma).powi(2)).exp();
    let weights: Vec<f64> = (0..=2 * radius as usize).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_JOINTS;

    /// A pose with its left side towards `(x, z)` of its right.
    fn turned(x: f32, z: f32) -> Pose {
        let mut pose = [[0.0; 3]; N_JOINTS];
        (pose[L_HIP], pose[R_HIP]) = ([0.1 * x, 1.0, 0.1 * z], [-0.1 * x, 1.0, -0.1 * z]);
        (pose[L_SHOULDER], pose[R_SHOULDER]) = ([0.2 * x, 1.4, 0.2 * z], [-0.2 * x, 1.4, -0.2 * z]);
        pose
    }

    #[test]
    fn a_body_with_its_left_towards_x_faces_z_already() {
        assert_eq!(facing_turn(&turned(1.0, 0.0)), Yaw::IDENTITY);
        let (x, z) = facing_turn(&turned(0.0, -1.0)).rotate_xz(1.0, 0.0);
        assert!(x.abs() < 1e-7 && (z - 1.0).abs() < 1e-7);
    }

    #[test]
    fn smoothing_keeps_a_constant_and_halves_a_step() {
        let weights = gaussian(20.0);
        assert_eq!(weights.len(), 161);
        assert!(smoothed(vec![3.0; 10], &weights).iter().all(|v| (v - 3.0).abs() < 1e-12));
        let step = smoothed([vec![-1.0; 200], vec![1.0; 200]].concat(), &weights);
        assert!((step[199] + step[200]).abs() < 1e-12);
        // One deviation from the step: erf(1/√2), less the tails that the window cuts off.
        assert!((step[219] - 0.6827).abs() < 0.02, "{}", step[219]);
        assert!((step[0] + 1.0).abs() < 1e-12 && (step[399] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_heading_of_a_spinning_body_never_changes_sign() {
        let spin = |t: usize| turned((t as f32 * 0.05).cos(), (t as f32 * 0.05).sin());
        let headings = root_headings(&(0..400).map(spin).collect::<Vec<_>>(), 20.0);
        assert_eq!(headings[0], Yaw::IDENTITY);
        assert!(headings.windows(2).skip(1).all(|pair| pair[0].dot(pair[1]) > 0.99));
        assert!(headings.iter().any(|heading| heading.w < -0.9), "it went round");
    }

    #[test]
    fn a_body_that_faces_nowhere_keeps_its_heading() {
        let shapeless = [[0.0; 3]; N_JOINTS];
        assert_eq!(facing_turn(&shapeless), Yaw::IDENTITY);
        assert_eq!(root_headings(&[shapeless; 5], 20.0), [Yaw::IDENTITY; 5]);
    }
}
