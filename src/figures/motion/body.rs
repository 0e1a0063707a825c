//! The stick figure: limbs by side, a head, and a nose that shows the facing direction.

use super::room::{Seen, see};
use crate::figures::colour::{INK, LEFT_SIDE, RIGHT_SIDE, Rgb};
use crate::motion::{CHAINS, L_HIP, L_SHOULDER, Pose, R_HIP, R_SHOULDER};

/// Radius of the head, metres.
pub const HEAD_RADIUS: f64 = 0.1;
/// The drawing lies within this many metres of a joint, seen from the side.
pub const REACH: f64 = 0.18;
/// Distance of the nose from the middle of the head, metres.
const NOSE: f64 = 0.16;
/// Metres.
const LIMB_WIDTH: f64 = 0.045;
const TRUNK_WIDTH: f64 = 0.055;
/// The joint in the middle of the head.
const HEAD: usize = 15;

/// Joints that one line joins, or the nose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    /// A chain of joints.
    Limb(&'static [usize]),
    /// From the middle of the head to the front.
    Nose,
}

/// A line of the figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    pub part: Part,
    pub colour: Rgb,
    /// Metres.
    pub width: f64,
}

/// Every line of the figure: right leg, left leg, trunk, right arm, left arm, nose.
const STROKES: [Stroke; 6] = [
    Stroke { part: Part::Limb(CHAINS[0]), colour: RIGHT_SIDE, width: LIMB_WIDTH },
    Stroke { part: Part::Limb(CHAINS[1]), colour: LEFT_SIDE, width: LIMB_WIDTH },
    Stroke { part: Part::Limb(CHAINS[2]), colour: INK, width: TRUNK_WIDTH },
    Stroke { part: Part::Limb(CHAINS[3]), colour: RIGHT_SIDE, width: LIMB_WIDTH },
    Stroke { part: Part::Limb(CHAINS[4]), colour: LEFT_SIDE, width: LIMB_WIDTH },
    Stroke { part: Part::Nose, colour: INK, width: LIMB_WIDTH },
];

impl Stroke {
    /// The corners of the line in a pose.
    pub fn corners(&self, pose: &Pose) -> Vec<Seen> {
        match self.part {
            Part::Limb(joints) => joints.iter().map(|&j| see(pose[j].map(f64::from))).collect(),
            Part::Nose => {
                let (at, [x, z]) = (pose[HEAD].map(f64::from), front(pose));
                vec![see(at), see([at[0] + NOSE * x, at[1], at[2] + NOSE * z])]
            }
        }
    }

    /// Whether the head is drawn with the line.
    pub fn has_head(&self) -> bool {
        matches!(self.part, Part::Limb(joints) if joints.contains(&HEAD))
    }

    /// How near the viewer the line is in the mean.
    fn nearness(&self, pose: &Pose) -> f64 {
        let corners = self.corners(pose);
        corners.iter().map(|seen| seen.near).sum::<f64>() / corners.len() as f64
    }
}

/// The middle of the head.
pub fn head(pose: &Pose) -> Seen {
    see(pose[HEAD].map(f64::from))
}

/// The horizontal direction `left × up` in which hips and shoulders face, of length 1; a body that
/// lies on its side, and faces nowhere, gets no direction.
fn front(pose: &Pose) -> [f64; 2] {
    let left = |c: usize| {
        f64::from(pose[L_HIP][c] - pose[R_HIP][c] + pose[L_SHOULDER][c] - pose[R_SHOULDER][c])
    };
    let (x, z) = (-left(2), left(0));
    let length = x.hypot(z);
    if length > 1e-6 { [x / length, z / length] } else { [0.0; 2] }
}

/// The strokes of a motion, the farthest first by their mean over `poses`.
pub fn far_to_near(poses: &[Pose]) -> Vec<Stroke> {
    let nearness = |stroke: &Stroke| poses.iter().map(|pose| stroke.nearness(pose)).sum::<f64>();
    let mut strokes = STROKES.to_vec();
    strokes.sort_by(|a, b| nearness(a).total_cmp(&nearness(b)));
    strokes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{JOINT_NAMES, N_JOINTS};

    #[test]
    fn colours_are_those_of_the_side() {
        for stroke in STROKES {
            let Part::Limb(joints) = stroke.part else { continue };
            let colour = match JOINT_NAMES[joints[joints.len() - 1]].split('_').next() {
                Some("left") => LEFT_SIDE,
                Some("right") => RIGHT_SIDE,
                _ => INK,
            };
            assert_eq!(stroke.colour, colour, "{joints:?}");
        }
    }

    #[test]
    fn a_body_with_its_left_to_x_faces_z() {
        let mut pose = [[0.0; 3]; N_JOINTS];
        (pose[L_HIP], pose[R_HIP]) = ([0.1, 0.9, 0.0], [-0.1, 0.9, 0.0]);
        assert_eq!(front(&pose), [0.0, 1.0]);
        assert_eq!(front(&[[0.0; 3]; N_JOINTS]), [0.0, 0.0]);
    }

    #[test]
    fn the_side_towards_the_viewer_is_drawn_last() {
        let mut pose = [[0.0; 3]; N_JOINTS];
        for joint in 1..N_JOINTS {
            let side = JOINT_NAMES[joint].split('_').next();
            pose[joint][0] =
                f32::from(i8::from(side == Some("left")) - i8::from(side == Some("right")));
        }
        let order = far_to_near(&[pose]);
        assert_eq!(order[0].colour, LEFT_SIDE);
        assert_eq!(order[5].colour, RIGHT_SIDE);
    }
}
