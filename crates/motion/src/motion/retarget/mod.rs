//! Retargets other skeletons' motion to HumanML3D's skeleton.
//!
//! ```text
//! names → Roles ─┐
//! frames → Survey┴→ Rig ─→ follow → resampled
//! ```
//!
//! [`roles_of`] assigns roles to joints. [`Survey`] sums over frames the axes and standing bodies of each file;
//! [`Rig::of`] combines all files of a skeleton into the mapping to the target. [`follow()`] gives a pose for each
//! frame, and [`resampled`] changes the rate. Positions of the 22 joints alone go through [`settled`].

mod body;
mod rig;
mod roles;
mod target;

pub use body::{Pose64, Up, reflected, reflected_joint};
pub use rig::{Neutral, Rig, RigError, Survey, follow, unit_m};
pub(crate) use roles::words;
pub use roles::{NameMap, RoleError, Roles, draft, roles_of, with_ends};
pub use target::{PointsError, Settled, leg_ratio, resampled, settled, with_lengths};
