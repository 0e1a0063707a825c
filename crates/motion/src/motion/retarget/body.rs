//! [`Body`]: the stance of a body from its joint positions, and the up axis of a file.

use std::fmt;
use std::str::FromStr;

use super::roles::Roles;
use crate::motion::bvh::{Axis, Placed};
use crate::motion::geometry::{Point, add, align, cross, dot, norm, scale, sub, with_length};
use crate::motion::{N_JOINTS, NO_ROTATION, Quat, rotate};

/// A pose in double precision.
pub type Pose64 = [Point; N_JOINTS];

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

    /// The direction from the ankles to the shoulders; zero if they coincide.
    pub fn height(&self) -> Point {
        with_length(sub(self.middle([16, 17]), self.middle([7, 8])), 1.0).unwrap_or_default()
    }

    /// Mean length of the two legs, hip to knee to ankle.
    pub fn leg(&self) -> f64 {
        let bone = |a: usize, b: usize| norm(sub(self.at(b), self.at(a)));
        (bone(1, 4) + bone(4, 7) + bone(2, 5) + bone(5, 8)) / 2.0
    }

    /// The rotation of an upright body with the same facing: x to its left, `up` above.
    /// `None` if its hips and shoulders lie along `up`.
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

    /// Mean forward direction of the toes, from −1 to 1; `None` without toes.
    pub fn toes_forward(&self, up: Point) -> Option<f64> {
        let facing = self.facing(up).filter(|_| self.has_toes)?;
        let forward = rotate(facing, Axis::Z.unit());
        let foot = |ankle: usize| with_length(sub(self.at(ankle + 3), self.at(ankle)), 1.0);
        Some((dot(foot(7)?, forward) + dot(foot(8)?, forward)) / 2.0)
    }
}

// Which way is up in a file, and which hand its axes have.

/// The axis of a file that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Up {
    axis: Axis,
    /// Whether the axis points down.
    reversed: bool,
}

/// The share of a direction that must lie along its largest axis, to name that axis.
const CLEAR: f64 = 0.8;

impl Up {
    /// The axis along which `direction` lies; `None` if it lies between two.
    pub fn along(direction: Point) -> Option<Up> {
        let length = norm(direction);
        let axis = Axis::along(direction);
        let part = direction[axis as usize];
        (part.abs() > CLEAR * length).then_some(Up { axis, reversed: part < 0.0 })
    }

    /// The turn that makes it y.
    pub fn turn(self) -> Quat {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        match (self.axis, self.reversed) {
            (Axis::Y, false) => [1.0, 0.0, 0.0, 0.0],
            (Axis::Y, true) => [0.0, 1.0, 0.0, 0.0],
            (Axis::Z, false) => [half, -half, 0.0, 0.0],
            (Axis::Z, true) => [half, half, 0.0, 0.0],
            (Axis::X, false) => [half, 0.0, 0.0, half],
            (Axis::X, true) => [half, 0.0, 0.0, -half],
        }
    }
}

impl fmt::Display for Up {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let sign = if self.reversed { "-" } else { "" };
        write!(f, "{sign}{}", format!("{:?}", self.axis).to_lowercase())
    }
}

impl FromStr for Up {
    type Err = String;

    fn from_str(text: &str) -> Result<Up, String> {
        let (reversed, name) = text.strip_prefix('-').map_or((false, text), |name| (true, name));
        let axis = match name {
            "x" => Axis::X,
            "y" => Axis::Y,
            "z" => Axis::Z,
            _ => return Err("an axis is x, y, z, -x, -y or -z".to_string()),
        };
        Ok(Up { axis, reversed })
    }
}

/// A point of left-handed axes in right-handed ones.
pub fn reflected([x, y, z]: Point) -> Point {
    [-x, y, z]
}

/// A joint of left-handed axes in right-handed ones.
pub fn reflected_joint(joint: Placed) -> Placed {
    let [w, x, y, z] = joint.rotation;
    Placed { rotation: [w, x, -y, -z], position: reflected(joint.position) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_axis_is_turned_up() {
        for name in ["x", "y", "z", "-x", "-y", "-z"] {
            let up: Up = name.parse().unwrap();
            assert_eq!(up.to_string(), name);
            let sign = if name.starts_with('-') { -1.0 } else { 1.0 };
            let direction = up.axis.unit().map(|c| c * sign);
            assert_eq!(Up::along(direction), Some(up));
            let turned = rotate(up.turn(), direction);
            assert!((turned[1] - 1.0).abs() < 1e-12, "{name}: {turned:?}");
        }
        assert_eq!(Up::along([1.0, 1.0, 0.0]), None);
        assert!("w".parse::<Up>().unwrap_err().contains("-z"));
    }

    #[test]
    fn a_reflected_rotation_turns_reflected_points() {
        let rotation = [0.5, 0.5, -0.5, 0.5];
        let joint = Placed { rotation, position: [1.0, 2.0, 3.0] };
        let mirrored = reflected_joint(joint);
        let point = [0.3, -0.4, 0.7];
        let expected = reflected(rotate(rotation, point));
        let found = rotate(mirrored.rotation, reflected(point));
        assert!(expected.iter().zip(found).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
