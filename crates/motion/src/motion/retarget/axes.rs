//! Which way is up in a file, and which hand its axes have.

use std::fmt;
use std::str::FromStr;

use crate::motion::Quat;
use crate::motion::bvh::{Axis, Placed};
use crate::motion::vector::{Point, norm};

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
    /// The axis along which `direction` lies; `None` where it lies between two.
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
    use crate::motion::rotate;

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
