//! Other skeletons' motion on HumanML3D's skeleton.
//!
//! ```text
//! names → Roles ─┐
//! frames → Survey┴→ Rig ─→ follow → resampled
//! ```
//!
//! [`roles_of`] finds which joint plays which part. [`Survey`] sums what the frames of each file say of its
//! axes and of standing bodies; [`Rig::of`] makes of all files of a skeleton what moves the target.
//! [`follow()`] gives a pose for each frame, and [`resampled`] changes the rate. Joints that are given as
//! places of the 22 joints alone go through [`settled`].

mod axes;
mod body;
mod follow;
mod names;
mod points;
mod resample;
mod rest;
mod rig;
mod roles;
mod survey;
mod target;
#[cfg(test)]
mod tests;
mod tree;

pub use axes::{Up, reflected, reflected_joint};
pub use follow::{follow, unit_m};
pub(crate) use names::words;
pub use points::{PointsError, Settled, leg_ratio, settled};
pub use resample::resampled;
pub use rig::{Neutral, Rig, RigError};
pub use roles::{NameMap, RoleError, Roles, draft, roles_of};
pub use survey::Survey;
pub use target::{Pose64, with_lengths};

use super::bvh::{Bvh, BvhJoint};

/// The hierarchy with a joint for each End Site, named after the joint that it ends.
pub fn with_ends(mut bvh: Bvh) -> Bvh {
    let ends: Vec<BvhJoint> = (bvh.joints.iter().enumerate())
        .flat_map(|(parent, joint)| {
            joint.end_sites.iter().map(move |offset| (parent, joint, *offset))
        })
        .map(|(parent, joint, offset)| BvhJoint {
            name: format!("{}{}", joint.name, tree::END),
            parent: Some(parent),
            offset,
            channels: Vec::new(),
            end_sites: Vec::new(),
        })
        .collect();
    bvh.joints.extend(ends);
    bvh
}
