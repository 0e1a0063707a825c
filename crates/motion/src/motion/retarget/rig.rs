//! [`Rig`]: how a file's skeleton moves HumanML3D's.

use super::axes::Up;
use super::body::{ASTRIDE, BACKWARDS, Body};
use super::roles::Roles;
use super::survey::{Survey, carrier};
use crate::motion::align::align;
use crate::motion::bvh::{Axis, Placed};
use crate::motion::vector::norm;
use crate::motion::{N_JOINTS, NO_ROTATION, Quat, conjugate, multiply, rotate};

/// Frames of standing bodies from which a neutral pose is taken, at least.
const STANDING: usize = 10;

/// Where the body is known to stand upright.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Neutral {
    /// The pose of the OFFSETs is a T or an A.
    ZeroPose,
    /// The mean over so many frames in which legs and trunk are upright.
    Standing(usize),
}

/// What moves the target skeleton: which joints, and how each is turned when the body stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    pub roles: Roles,
    pub up: Up,
    pub neutral: Neutral,
    /// For each bone that a joint carries, from the upright body's axes to those of that joint.
    pub rests: [Quat; N_JOINTS],
}

/// Why a skeleton cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RigError {
    #[error("stands along no axis, so that no axis is clearly up; give --up")]
    Up,
    #[error(
        "has no neutral pose: its OFFSETs are no T-pose, and the body stands upright in {0} frames of all \
         files of this skeleton, where 10 are needed; import it with a capture of a standing body"
    )]
    NoNeutral(usize),
    #[error(
        "has its toes behind its ankles: its axes are left-handed, or left and right are exchanged; give \
         --left-handed, or a mapping"
    )]
    Backwards,
}

impl Rig {
    /// Of a skeleton, from the pose of its OFFSETs and the sums over all its files.
    ///
    /// Where the pose of the OFFSETs is a standing body it is the neutral pose. If it is not (in Bandai
    /// Namco's and LaFAN1's files every bone of that pose lies along an axis), the mean over standing
    /// frames is.
    ///
    /// # Errors
    /// [`RigError`].
    pub fn of(
        zero: &[Placed],
        roles: Roles,
        survey: &Survey,
        told: Option<Up>,
    ) -> Result<Rig, RigError> {
        let up = told.or(Up::along(survey.height)).ok_or(RigError::Up)?;
        let (toes, shown) = survey.toes;
        if shown > 0 && toes / (shown as f64) < BACKWARDS {
            return Err(RigError::Backwards);
        }
        if let Some(facing) = neutral_zero(&Body::of(zero, &roles)) {
            let back = |carrier: usize| multiply(conjugate(zero[carrier].rotation), facing);
            let rests = std::array::from_fn(|joint| carrier(&roles, joint).map_or(facing, back));
            return Ok(Rig { roles, up, neutral: Neutral::ZeroPose, rests });
        }
        if survey.standing < STANDING {
            return Err(RigError::NoNeutral(survey.standing));
        }
        let axes = Axis::ALL.map(Axis::unit);
        let rests = survey.upright.map(|sums| align(&axes, &sums, NO_ROTATION));
        Ok(Rig { roles, up, neutral: Neutral::Standing(survey.standing), rests })
    }
}

/// The facing of the pose of the OFFSETs, where it is a body that stands with its toes in front.
fn neutral_zero(body: &Body) -> Option<Quat> {
    let up = Up::along(body.height())?;
    let up = rotate(conjugate(up.turn()), [0.0, 1.0, 0.0]);
    let toes = body.toes_forward(up).is_none_or(|forward| forward > 0.5);
    (toes && norm(body.height()) > 0.0 && body.stands(up, ASTRIDE))
        .then(|| body.facing(up))
        .flatten()
}
