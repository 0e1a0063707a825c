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

mod align;
pub mod bvh;
mod complete;
mod features;
#[cfg(test)]
mod fixtures;
mod heading;
mod metrics;
mod mirror;
mod recover;
pub mod retarget;
mod rotation;
mod skeleton;
pub mod synth;
pub(crate) mod vector;

/// Features of one frame in the HumanML3D layout with 22 joints.
pub const N_FEATURES: usize = 263;

pub use complete::complete_features;
pub use features::{
    CONTACT_THRESHOLD_M2, CONTACTS, POSITIONS, ROOT_HEIGHT, ROOT_VELOCITY, ROOT_YAW, ROTATIONS,
    VELOCITIES, build_features, canonicalise, features_of_canonical, is_canonical,
};
pub use metrics::mpjpe_mm;
pub use mirror::{mirror_caption, mirror_features};
pub use recover::{recover_body, recover_joints, width as feature_width};
pub use rotation::{NO_ROTATION, Quat, Yaw, between, conjugate, multiply, rotate, to_6d};
pub use skeleton::{
    BONE_LENGTHS, CHAINS, CONTACT_JOINTS, JOINT_NAMES, L_HIP, L_SHOULDER, MIRROR_PARTNER, N_JOINTS,
    PARENTS, Pose, R_HIP, R_SHOULDER, RAW_OFFSETS,
};
