//! [`Body`]: what the places of a body's joints say of its stance.

use super::roles::Roles;
use super::target::Pose64;
use crate::motion::align::align;
use crate::motion::bvh::{Axis, Placed};
use crate::motion::vector::{Point, add, cross, dot, norm, scale, sub, with_length};
use crate::motion::{NO_ROTATION, Quat, rotate};

/// Cosine within which a thigh or a shin of a standing body is vertical: 20°.
pub const STANDING: f64 = 0.94;
/// The same of a body with its legs apart: 35°. CMU's skeletons are built with 20°.
pub const ASTRIDE: f64 = 0.82;
/// Cosine within which the trunk of a standing body is vertical: 15°.
const TRUNK_UPRIGHT: f64 = 0.966;

/// Mean cosine between toes and facing below which axes are left-handed or sides exchanged.
pub const BACKWARDS: f64 = -0.3;

/// The places of the 22 joints in a frame, in any unit and with any axis up.
pub struct Body {
    places: Pose64,
    has_toes: bool,
}

impl From<&Pose64> for Body {
    fn from(places: &Pose64) -> Body {
        Body { places: *places, has_toes: true }
    }
}

impl Body {
    /// A frame of a file, seen through the roles of its joints; a joint that it has not lies at zero.
    pub fn of(joints: &[Placed], roles: &Roles) -> Body {
        let place = |joint: Option<usize>| joint.map_or([0.0; 3], |joint| joints[joint].position);
        Body { places: roles.map(place), has_toes: roles[10].and(roles[11]).is_some() }
    }

    /// Place of a joint that every file has; see [`roles_of`](super::roles_of).
    pub fn at(&self, role: usize) -> Point {
        self.places[role]
    }

    fn middle(&self, [left, right]: [usize; 2]) -> Point {
        scale(add(self.at(left), self.at(right)), 0.5)
    }

    /// Between the hips.
    pub fn hips(&self) -> Point {
        self.middle([1, 2])
    }

    /// The direction from the ankles to the shoulders; zero where they lie on one another.
    pub fn height(&self) -> Point {
        with_length(sub(self.middle([16, 17]), self.middle([7, 8])), 1.0).unwrap_or_default()
    }

    /// Mean length of the two legs, hip to knee to ankle.
    pub fn leg(&self) -> f64 {
        let bone = |a: usize, b: usize| norm(sub(self.at(b), self.at(a)));
        (bone(1, 4) + bone(4, 7) + bone(2, 5) + bone(5, 8)) / 2.0
    }

    /// The rotation of a body that stands upright and faces as this one does: x to its left, `up` above.
    /// `None` where its hips and shoulders lie along `up`.
    pub fn facing(&self, up: Point) -> Option<Quat> {
        let across = add(sub(self.at(1), self.at(2)), sub(self.at(16), self.at(17)));
        let level = sub(across, scale(up, dot(across, up)));
        let left = with_length(level, 1.0)?;
        Some(align(&Axis::ALL.map(Axis::unit), &[left, up, cross(left, up)], NO_ROTATION))
    }

    /// Whether the trunk is upright, and the legs within the angle of a cosine.
    pub fn stands(&self, up: Point, legs_within: f64) -> bool {
        let cosine = |from: Point, to: Point| {
            let bone = sub(to, from);
            dot(bone, up) / norm(bone).max(f64::MIN_POSITIVE)
        };
        let legs = [(4, 1), (7, 4), (5, 2), (8, 5)];
        let upright = |(below, above): (usize, usize)| cosine(self.at(below), self.at(above));
        legs.into_iter().all(|bone| upright(bone) > legs_within)
            && cosine(self.hips(), self.middle([16, 17])) > TRUNK_UPRIGHT
    }

    /// How far the toes point forward, from −1 to 1, the mean of both; `None` without toes.
    pub fn toes_forward(&self, up: Point) -> Option<f64> {
        let facing = self.facing(up).filter(|_| self.has_toes)?;
        let forward = rotate(facing, Axis::Z.unit());
        let foot = |ankle: usize| with_length(sub(self.at(ankle + 3), self.at(ankle)), 1.0);
        Some((dot(foot(7)?, forward) + dot(foot(8)?, forward)) / 2.0)
    }
}
