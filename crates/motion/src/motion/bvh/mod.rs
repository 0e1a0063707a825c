//! BVH: a hierarchy of joints with offsets, and their channels frame by frame, as text.
//!
//! Data flows one way in each direction:
//!
//! - poses → [`fit_bvh`] (rest pose, rotations, Euler angles) → [`Bvh`] → text, by `Display`;
//! - text → [`Bvh::parse`] → [`Bvh`] → [`Bvh::positions`] (forward kinematics).
//!
//! Files are written in centimetres and degrees, y up, the rest pose facing +z. The rotations come
//! from the joints' positions, never from the 6-D columns of the features: those begin the arms at
//! the root's rotation, which no ordinary hierarchy does.

mod error;
mod euler;
mod fit;
mod format;
mod hierarchy;
mod kinematics;
mod nodes;
mod parse;
mod rest;
#[cfg(test)]
mod tests;

pub use error::BvhError;
pub use fit::{Deviation, FitBvhError, FittedBvh, fit_bvh};
pub use hierarchy::{Axis, Bvh, BvhJoint, Channel};
pub use kinematics::Placed;
