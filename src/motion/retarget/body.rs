//! [`Body`]: what the places of a body's joints say of its stance.

use super::roles::Roles;
use crate::motion::bvh::Placed;
use crate::motion::vector::{Point, add, cross, dot, norm, scale, sub, with_length};
use crate::motion::{Quat, align::align};

/// Cosine within which a thigh or a shin of a standing body is vertical: 20°.
pub const STANDING: f64 = 0.94;
/// The same of a body with its legs apart: 35°. CMU's skeletons are built with 20°.
pub const ASTRIDE: f64 = 0.82;
/// Cosine within which the trunk of a standing body is vertical: 15°.
const TRUNK_UPRIGHT: f64 = 0.966;

/// A frame of a file, seen through the roles of its joints.
pub struct Body<'a> {
    pub joints: &'a [Placed],
    pub roles: &'a Roles,
}

impl Body<'_> {
    /// Place of a joint that every file has; see [`roles_of`](super::roles_of).
    pub fn at(&self, role: usize) -> Point {
        self.roles[role].map_or([0.0; 3], |joint| self.joints[joint].position)
    }

    fn middle(&self, [left, right]: [usize; 2]) -> Point {
        scale(add(self.at(left), self.at(right)), 0.5)
    }

    /// Between the hips.
    pub fn hips(&self) -> Point {
        self.middle([1, 2])
    }

    /// From the ankles to the shoulders.
    pub fn height(&self) -> Point {
        sub(self.middle([16, 17]), self.middle([7, 8]))
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
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Some(align(&axes, &[left, up, cross(left, up)], [1.0, 0.0, 0.0, 0.0]))
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
        self.roles[10].and(self.roles[11])?;
        let forward = crate::motion::rotate(self.facing(up)?, [0.0, 0.0, 1.0]);
        let foot = |ankle: usize| with_length(sub(self.at(ankle + 3), self.at(ankle)), 1.0);
        Some((dot(foot(7)?, forward) + dot(foot(8)?, forward)) / 2.0)
    }
}
