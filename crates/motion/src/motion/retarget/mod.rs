//! Retargets other skeletons' motion to HumanML3D's skeleton.
//!
//! ```text
//! names → Roles ─┐
//! frames → Survey┴→ Rig ─→ follow → resampled
//! ```
//!
//! [`roles_of`] finds which joint plays which part. [`Survey`] sums what the frames of each file say of its
//! axes and of standing bodies; [`Rig::of`] makes of it, and of all files of a skeleton, what moves the target.
//! [`follow()`] gives a pose for each frame, and [`resampled`] changes the rate. Joints that are given as
//! places of the 22 joints alone go through [`settled`].

mod body;
mod rig;
mod roles;
mod target;

pub use body::{BACKWARDS, Pose64, Up, reflected, reflected_joint};
pub use rig::{Differs, Neutral, Rig, RigError, Survey, follow, unit_m};
pub(crate) use roles::words;
pub use roles::{NameMap, RoleError, Roles, draft, roles_of, with_ends};
pub use target::{
    PointsError, Settled, Stance, has_target_bones, resampled, settled, with_lengths,
};
