//! [`Survey`]: what the frames of one file say of its axes and of its neutral pose.

use super::axes::Up;
use super::body::{Body, STANDING};
use super::roles::Roles;
use crate::motion::bvh::Placed;
use crate::motion::vector::{Point, add, with_length};
use crate::motion::{N_JOINTS, PARENTS, conjugate, multiply, rotate};

/// Sums over the frames of a file; those of several files of one skeleton add up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    pub n_frames: usize,
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
        let mut survey = Survey { n_frames: frames.len(), ..Survey::default() };
        for joints in frames {
            let height = with_length(Body { joints, roles }.height(), 1.0).unwrap_or_default();
            survey.height = add(survey.height, height);
        }
        let Some(up) = told.or(Up::along(survey.height)) else { return survey };
        let up = rotate(conjugate(up.turn()), [0.0, 1.0, 0.0]);
        frames.iter().for_each(|joints| survey.look(&Body { joints, roles }, up));
        survey
    }

    fn look(&mut self, body: &Body, up: Point) {
        if let Some(forward) = body.toes_forward(up) {
            self.toes = (self.toes.0 + forward, self.toes.1 + 1);
        }
        let Some(facing) = body.facing(up).filter(|_| body.stands(up, STANDING)) else { return };
        self.standing += 1;
        for (joint, sums) in self.upright.iter_mut().enumerate() {
            let Some(carrier) = carrier(body.roles, joint) else { continue };
            let rest = multiply(conjugate(body.joints[carrier].rotation), facing);
            for (axis, sum) in sums.iter_mut().enumerate() {
                *sum = add(*sum, rotate(rest, unit(axis)));
            }
        }
    }

    /// The sums of both.
    pub fn and(mut self, other: &Survey) -> Survey {
        self.n_frames += other.n_frames;
        self.height = add(self.height, other.height);
        self.toes = (self.toes.0 + other.toes.0, self.toes.1 + other.toes.1);
        self.standing += other.standing;
        let sums = self.upright.iter_mut().flatten().zip(other.upright.iter().flatten());
        sums.for_each(|(sum, more)| *sum = add(*sum, *more));
        self
    }
}

/// The unit vector along an axis.
pub fn unit(axis: usize) -> Point {
    std::array::from_fn(|i| f64::from(u8::from(i == axis)))
}
