//! [`Survey`]: what the frames of one file say of its axes and of its neutral pose.

use super::axes::Up;
use super::body::{Body, STANDING};
use super::roles::Roles;
use crate::motion::bvh::{Axis, Placed};
use crate::motion::vector::{Point, add};
use crate::motion::{N_JOINTS, PARENTS, conjugate, multiply, rotate};

/// Sums over the frames of a file; those of several files of one skeleton add up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// Directions from the ankles to the shoulders.
    pub height: Point,
    /// How far the toes point forward, and the frames in which it shows.
    pub toes: (f64, usize),
    /// Frames in which the body stands.
    pub standing: usize,
    /// Over those, for each joint: the axes of the upright body in the frame of the joint that carries its
    /// bone.
    pub upright: [[Point; 3]; N_JOINTS],
}

/// The joint whose rotation carries the bone that ends in `joint`: that of the parent's role. Without a
/// collar bone the chest carries the shoulder, without a neck the head.
pub fn carrier(roles: &Roles, joint: usize) -> Option<usize> {
    let parent = PARENTS[joint]?;
    roles[parent].or_else(|| carrier(roles, parent))
}

impl Survey {
    /// Of a file's frames, with the axis that is told to point up, or else the one along which the body of
    /// this file stands.
    pub fn of(frames: &[Vec<Placed>], roles: &Roles, told: Option<Up>) -> Survey {
        let heights = frames.iter().map(|joints| Body::of(joints, roles).height());
        let mut survey = Survey { height: heights.fold([0.0; 3], add), ..Survey::default() };
        let Some(up) = told.or(Up::along(survey.height)) else { return survey };
        let up = rotate(conjugate(up.turn()), [0.0, 1.0, 0.0]);
        frames.iter().for_each(|joints| survey.look(joints, roles, up));
        survey
    }

    fn look(&mut self, joints: &[Placed], roles: &Roles, up: Point) {
        let body = Body::of(joints, roles);
        if let Some(forward) = body.toes_forward(up) {
            self.toes = (self.toes.0 + forward, self.toes.1 + 1);
        }
        let Some(facing) = body.facing(up).filter(|_| body.stands(up, STANDING)) else { return };
        self.standing += 1;
        for (joint, sums) in self.upright.iter_mut().enumerate() {
            let Some(carrier) = carrier(roles, joint) else { continue };
            let rest = multiply(conjugate(joints[carrier].rotation), facing);
            for (axis, sum) in Axis::ALL.into_iter().zip(sums) {
                *sum = add(*sum, rotate(rest, axis.unit()));
            }
        }
    }

    /// The sums of both.
    pub fn and(mut self, other: &Survey) -> Survey {
        self.height = add(self.height, other.height);
        self.toes = (self.toes.0 + other.toes.0, self.toes.1 + other.toes.1);
        self.standing += other.standing;
        let sums = self.upright.iter_mut().flatten().zip(other.upright.iter().flatten());
        sums.for_each(|(sum, more)| *sum = add(*sum, *more));
        self
    }
}
