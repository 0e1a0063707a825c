//! Joints into HumanML3D features and back, mirroring, BVH, other skeletons, and the distance between
//! motions.
//!
//! # Example
//!
//! ```
//! use isoflop_motion::motion::synth::Script;
//! use isoflop_motion::motion::{N_FEATURES, build_features, mpjpe_mm, recover_joints};
//! use rand_chacha::ChaCha8Rng;
//! use rand_chacha::rand_core::SeedableRng;
//!
//! let poses = Script::sample(&mut ChaCha8Rng::seed_from_u64(0)).poses(); // [T + 1, 22, 3], metres
//! let features = build_features(&poses); // [T, 263]
//! assert_eq!(features.len(), (poses.len() - 1) * N_FEATURES);
//! // Joints again, standing over the origin and facing +z in the first frame; bones keep their lengths.
//! let joints = recover_joints(&features);
//! let twice = recover_joints(&build_features(&joints));
//! assert!(mpjpe_mm(&joints[..twice.len()], &twice) < 1.0);
//! ```

pub mod bvh;
mod features;
mod feet;
pub(crate) mod geometry;
mod join;
mod mirror;
mod recover;
pub mod retarget;
mod skeleton;
pub mod synth;

/// Features of one frame in the HumanML3D layout with 22 joints.
pub const N_FEATURES: usize = 263;

pub(crate) use features::lowest;
pub use features::{
    CONTACTS, POSITIONS, ROOT_HEIGHT, ROOT_VELOCITY, ROOT_YAW, ROTATIONS, VELOCITIES,
    build_features, build_features_at, canonicalise, features_of_canonical,
    features_of_canonical_at, is_canonical,
};
pub use feet::{MovedFeet, ON_FLOOR, clean_feet};
pub use geometry::{NO_ROTATION, Quat, Yaw, between, conjugate, multiply, rotate, to_6d};
pub use join::{join_weights, joined};
pub use mirror::{mirror_caption, mirror_features};
pub use recover::{complete_features, feature_width, recover_body, recover_joints};
pub use skeleton::{
    BONE_LENGTHS, CHAINS, CONTACT_JOINTS, JOINT_NAMES, L_HIP, L_SHOULDER, MIRROR_PARTNER, N_JOINTS,
    PARENTS, Pose, R_HIP, R_SHOULDER, RAW_OFFSETS, mpjpe_mm,
};

/// Made-up motions for tests.
#[cfg(test)]
pub(crate) mod fixtures {
    use std::path::{Path, PathBuf};

    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::geometry::{Point, cross, norm, sub};
    use super::retarget::Pose64;
    use super::synth::Script;
    use super::*;

    /// Poses of a procedural clip.
    pub fn procedural(seed: u64) -> Vec<Pose> {
        Script::sample(&mut ChaCha8Rng::seed_from_u64(seed)).poses()
    }

    /// A folder of real motion; none, with a word, where it is not at hand.
    pub fn real(name: &str) -> Option<PathBuf> {
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
        let path = data.join(name);
        if !path.is_dir() {
            eprintln!("skipped: {} is not there", path.display());
            return None;
        }
        Some(path)
    }

    /// `n` frames of a body that walks a curve and swings every joint at its own pace.
    pub fn dance(n: usize) -> Vec<Pose> {
        (0..n).map(|t| figure(t as f32 / 20.0)).collect()
    }

    fn figure(t_s: f32) -> Pose {
        let mut pose = [[0.0; 3]; N_JOINTS];
        pose[0] = [t_s, 0.9 + 0.05 * (5.0 * t_s).sin(), 0.3 * t_s * t_s];
        for joint in 1..N_JOINTS {
            let parent = pose[PARENTS[joint].expect("only the pelvis has no parent")];
            let swing = |c: usize| 0.3 * ((1.0 + joint as f32 * 0.17) * t_s + c as f32).sin();
            pose[joint] = std::array::from_fn(|c| {
                parent[c] + BONE_LENGTHS[joint] * (RAW_OFFSETS[joint][c] + swing(c))
            });
        }
        moved(&[pose], f64::from(0.4 * t_s), [0.0; 3])[0]
    }

    /// `poses` turned by twice `half_angle` about the vertical through the origin, then shifted.
    pub fn moved(poses: &[Pose], half_angle: f64, shift: [f32; 3]) -> Vec<Pose> {
        let turn = Yaw::from_half_angle(half_angle);
        let place = |joint: [f32; 3]| {
            let turned = turn.rotate(joint);
            std::array::from_fn(|c| turned[c] + shift[c])
        };
        poses.iter().map(|pose| pose.map(place)).collect()
    }

    /// `poses` with x reversed and left and right joints in each other's place.
    pub fn mirrored_poses(poses: &[Pose]) -> Vec<Pose> {
        let flipped = |pose: &Pose, joint: usize| {
            let [x, y, z] = pose[MIRROR_PARTNER[joint]];
            [-x, y, z]
        };
        poses.iter().map(|pose| std::array::from_fn(|joint| flipped(pose, joint))).collect()
    }

    /// The largest distance between corresponding values.
    pub fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
    }

    /// The rotation matrix, as its three columns, by Gram-Schmidt on the two columns `six`.
    ///
    /// The columns need not be of unit length nor at right angles, as a decoder gives them; if they
    /// are parallel or zero no rotation follows and the columns hold NaN.
    pub fn from_6d(six: [f32; 6]) -> [Point; 3] {
        let [a, b, c, d, e, f] = six.map(f64::from);
        let x = normalised([a, b, c]);
        let z = normalised(cross(x, [d, e, f]));
        [x, cross(z, x), z]
    }

    fn normalised(v: Point) -> Point {
        v.map(|c| c / norm(v))
    }

    /// The first frames of a walk, in double precision.
    pub fn poses64(n: usize) -> Vec<Pose64> {
        procedural(3)[..n].iter().map(|pose| pose.map(|joint| joint.map(f64::from))).collect()
    }

    /// The largest distance between corresponding joints.
    pub fn largest_distance(a: &[Pose64], b: &[Pose64]) -> f64 {
        let joints = a.as_flattened().iter().zip(b.as_flattened());
        joints.map(|(a, b)| norm(sub(*a, *b))).fold(0.0, f64::max)
    }
}
