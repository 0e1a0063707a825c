//! Joints into HumanML3D features and back, mirroring, BVH, other skeletons, and the distance between
//! motions.

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
mod vector;

/// Features of one frame in the HumanML3D layout with 22 joints.
pub const N_FEATURES: usize = 263;

pub use complete::complete_features;
pub use features::{
    CONTACT_THRESHOLD_M2, CONTACTS, POSITIONS, ROOT_HEIGHT, ROOT_VELOCITY, ROOT_YAW, ROTATIONS,
    VELOCITIES, build_features, canonicalise, features_of_canonical, is_canonical,
};
pub use metrics::mpjpe_mm;
pub use mirror::{mirror_caption, mirror_features};
pub use recover::recover_joints;
pub use rotation::{NO_ROTATION, Quat, Yaw, between, conjugate, from_6d, multiply, rotate, to_6d};
pub use skeleton::{
    BONE_LENGTHS, CHAINS, CONTACT_JOINTS, JOINT_NAMES, L_HIP, L_SHOULDER, MIRROR_PARTNER, N_JOINTS,
    PARENTS, Pose, R_HIP, R_SHOULDER, RAW_OFFSETS,
};
