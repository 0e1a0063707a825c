//! [`Rig`]: how a file's skeleton moves HumanML3D's; made from a [`Survey`] of its frames, followed frame by
//! frame.

use super::body::{ASTRIDE, BACKWARDS, Body, Pose64, STANDING, Up};
use super::roles::Roles;
use super::target::leg;
use crate::motion::bvh::{Axis, Placed};
use crate::motion::geometry::{Point, add, align, norm, scale, sub, with_length};
use crate::motion::{
    BONE_LENGTHS, N_JOINTS, NO_ROTATION, PARENTS, Quat, conjugate, multiply, rotate,
};

/// Sums over the frames of a file; sums of several files of one skeleton add up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// Directions from the ankles to the shoulders.
    pub height: Point,
    /// Sum of the toes' forward direction, and the number of frames with toes.
    pub toes: (f64, usize),
    /// Frames with a standing body.
    pub standing: usize,
    /// Over those, for each joint: the axes of the upright body in the frame of the joint that carries its
    /// bone.
    pub upright: [[Point; 3]; N_JOINTS],
}

/// The joint whose rotation carries the bone that ends in `joint`: that of the parent's role. Without a
/// collar bone the chest carries the shoulder, without a neck the head.
fn carrier(roles: &Roles, joint: usize) -> Option<usize> {
    let parent = PARENTS[joint]?;
    roles[parent].or_else(|| carrier(roles, parent))
}

impl Survey {
    /// Over a file's frames, with the given up axis, or the axis along which the body stands.
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

    /// The sums of a skeleton with the axes and the toes of one of its files, which is followed by them; and how the
    /// file differs from the others.
    ///
    /// A file that stands along an axis of its own has that axis up, also among others. One that lies along
    /// another axis than others stand, or along none, is taken to lie as they stand.
    pub fn with_axes_of(&self, own: &Survey) -> (Survey, Option<Differs>) {
        let (file, others) = (Up::along(own.height), Up::along(self.height));
        let differs = match (file, others) {
            (Some(own), Some(others)) if own != others => Some((own, others)),
            _ => None,
        };
        let is_own = file.is_some() && (differs.is_none() || own.standing >= STANDING_FRAMES);
        let Survey { height, toes, .. } = if is_own { own } else { self };
        let shown = if toes.1 > 0 { toes } else { &self.toes };
        let survey = Survey { height: *height, toes: *shown, ..self.clone() };
        let differs = differs.map(|(own, others)| match is_own {
            true => Differs::Stands { own, others },
            false => Differs::Lies { own, others },
        });
        (survey, differs)
    }

    /// Takes in the sums of another file.
    pub fn add(&mut self, other: &Survey) {
        self.height = add(self.height, other.height);
        self.toes = (self.toes.0 + other.toes.0, self.toes.1 + other.toes.1);
        self.standing += other.standing;
        let sums = self.upright.iter_mut().flatten().zip(other.upright.iter().flatten());
        sums.for_each(|(sum, more)| *sum = add(*sum, *more));
    }
}

/// How a file lies otherwise than the others of its skeleton.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Differs {
    #[error(
        "stands along {own}, where the others of its skeleton stand along {others}: it is read with {own} up; \
         if its body lies down, give --up {others}"
    )]
    Stands { own: Up, others: Up },
    #[error(
        "lies along {own} in most frames, and the others of its skeleton stand along {others}: it is read with \
         {others} up; if its own axis is {own}, import it by itself with --up {own}"
    )]
    Lies { own: Up, others: Up },
}

/// Frames of standing bodies from which a neutral pose is taken, at least.
const STANDING_FRAMES: usize = 10;

/// The source of the upright pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Neutral {
    /// The pose of the OFFSETs is a T or an A.
    ZeroPose,
    /// The mean over so many frames in which legs and trunk are upright.
    Standing(usize),
}

/// The mapping to the target skeleton: joints, and their rotations in the standing body.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    pub roles: Roles,
    pub up: Up,
    pub neutral: Neutral,
    /// For each bone of a joint, the rotation from the upright body's axes to the joint's.
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
    /// For a skeleton, from the pose of its OFFSETs and the sums over all its files.
    ///
    /// If the pose of the OFFSETs is a standing body, it is the neutral pose. Otherwise (in Bandai Namco's and LaFAN1's files
    /// every bone of that pose lies along an axis) the mean over standing frames is.
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
        if survey.standing < STANDING_FRAMES {
            return Err(RigError::NoNeutral(survey.standing));
        }
        let axes = Axis::ALL.map(Axis::unit);
        let rests = survey.upright.map(|sums| align(&axes, &sums, NO_ROTATION));
        Ok(Rig { roles, up, neutral: Neutral::Standing(survey.standing), rests })
    }
}

/// The facing of the pose of the OFFSETs, if it is a standing body with its toes in front.
fn neutral_zero(body: &Body) -> Option<Quat> {
    let up = Up::along(body.height())?;
    let up = rotate(conjugate(up.turn()), [0.0, 1.0, 0.0]);
    let toes = body.toes_forward(up).is_none_or(|forward| forward > 0.5);
    (toes && norm(body.height()) > 0.0 && body.stands(up, ASTRIDE))
        .then(|| body.facing(up))
        .flatten()
}

/// Metres of the target per unit of the file: the mean ratio of the legs over the frames.
///
/// `None` without frames, or if the legs have no length.
pub fn unit_m(frames: &[Vec<Placed>], rig: &Rig) -> Option<f64> {
    let legs = frames.iter().map(|joints| Body::of(joints, &rig.roles).leg());
    let mean = legs.sum::<f64>() / frames.len() as f64;
    (mean > 0.0 && mean.is_finite()).then(|| leg() / mean)
}

/// The pose of a frame: thighs, shins and arms lie along the file's own, trunk, collars, shoulders and feet
/// keep the target's shape and turn with the joints that carry them; the middle of the hips is the file's,
/// `unit_m` metres a unit.
pub fn follow(joints: &[Placed], rig: &Rig, unit_m: f64) -> Pose64 {
    let body = Body::of(joints, &rig.roles);
    let turn = rig.up.turn();
    let bone = |joint: usize| -> Point {
        let parent = PARENTS[joint].unwrap_or(0);
        let rest = REST.iter().find(|(own, _)| *own == joint);
        let bone = match (rest, carrier(&rig.roles, joint)) {
            (Some(&(_, rest)), Some(carrier)) => {
                rotate(multiply(joints[carrier].rotation, rig.rests[joint]), rest)
            }
            _ => sub(body.at(joint), body.at(parent)),
        };
        rotate(turn, with_length(bone, f64::from(BONE_LENGTHS[joint])).unwrap_or_default())
    };
    let hips = rotate(turn, scale(body.hips(), unit_m));
    let mut pose = [[0.0; 3]; N_JOINTS];
    pose[0] = sub(hips, scale(add(bone(1), bone(2)), 0.5));
    for joint in 1..N_JOINTS {
        pose[joint] = add(pose[PARENTS[joint].unwrap_or(0)], bone(joint));
    }
    pose
}

/// From its parent to each joint that keeps its place in the parent's frame, metres: x to the left, y up.
///
/// The means over 16,202 standing frames of CMU's captures on HumanML3D's skeleton, each turned to face +z;
/// the middle of the body is at x = 0. Lengths follow from [`BONE_LENGTHS`].
/// Thighs, shins and arms are not among them: they lie as the file's own.
const REST: [(usize, Point); 13] = [
    (1, [0.0599, -0.0836, -0.0052]),
    (2, [-0.0637, -0.0891, -0.0082]),
    (3, [0.0, 0.1277, -0.0311]),
    (6, [0.0, 0.1418, -0.0131]),
    (9, [0.0, 0.0522, 0.0233]),
    (10, [0.0377, -0.0576, 0.1230]),
    (11, [-0.0439, -0.0556, 0.1289]),
    (12, [0.0, 0.2160, -0.0346]),
    (13, [0.0747, 0.1118, -0.0273]),
    (14, [-0.0735, 0.1198, -0.0271]),
    (15, [0.0, 0.0612, 0.0775]),
    (16, [0.1242, 0.0414, -0.0112]),
    (17, [-0.1155, 0.0410, -0.0083]),
];

#[cfg(test)]
mod tests {
    use super::super::{NameMap, reflected_joint, roles_of, with_ends};
    use super::*;
    use crate::motion::bvh::{Bvh, fit_bvh};
    use crate::motion::fixtures::{largest_distance, poses64, procedural};
    use crate::motion::{JOINT_NAMES, MIRROR_PARTNER};

    #[test]
    fn bones_have_their_lengths_and_sides() {
        for (joint, rest) in REST {
            assert!((norm(rest) - f64::from(BONE_LENGTHS[joint])).abs() < 5e-3, "joint {joint}");
            let is_partner = |(other, _): &&(usize, Point)| *other == MIRROR_PARTNER[joint];
            let (_, partner) = REST.iter().find(is_partner).unwrap();
            assert!(rest[0] * partner[0] <= 0.0, "joint {joint}");
        }
    }

    /// A motion as a file of this program's own hierarchy, with a T as the pose of its OFFSETs.
    fn own_file(n: usize) -> Bvh {
        with_ends(fit_bvh(&procedural(3)[..n], 20.0).unwrap().bvh)
    }

    fn rig_of(bvh: &Bvh) -> Rig {
        let roles = roles_of(&bvh.joints, &NameMap::new()).unwrap();
        let survey = Survey::of(&bvh.placed(), &roles, None);
        Rig::of(&bvh.zero_pose(), roles, &survey, None).unwrap()
    }

    fn followed(bvh: &Bvh) -> Vec<Pose64> {
        let (frames, rig) = (bvh.placed(), rig_of(bvh));
        let unit_m = unit_m(&frames, &rig).unwrap();
        frames.iter().map(|joints| follow(joints, &rig, unit_m)).collect()
    }

    #[test]
    fn limbs_lie_as_in_the_file_and_bones_have_the_targets_lengths() {
        let bvh = own_file(60);
        let found = followed(&bvh);
        for (pose, truth) in found.iter().zip(poses64(60)) {
            for joint in 1..JOINT_NAMES.len() {
                let parent = PARENTS[joint].unwrap();
                let bone = sub(pose[joint], pose[parent]);
                assert!((norm(bone) - f64::from(BONE_LENGTHS[joint])).abs() < 1e-9);
                if [4, 5, 7, 8, 18, 19, 20, 21].contains(&joint) {
                    let own = sub(truth[joint], truth[parent]);
                    let off = norm(sub(scale(bone, 1.0 / norm(bone)), scale(own, 1.0 / norm(own))));
                    assert!(off < 0.01, "joint {joint}: {off}");
                }
            }
        }
    }

    #[test]
    fn units_axes_and_hands_do_not_matter() {
        let bvh = own_file(40);
        let (frames, rig) = (bvh.placed(), rig_of(&bvh));
        let truth = followed(&bvh);
        // Inches, z up: y becomes z.
        let turn = [std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0];
        let other = |joint: &Placed| Placed {
            rotation: multiply(turn, joint.rotation),
            position: scale(rotate(turn, joint.position), 1.0 / 2.54),
        };
        let turned: Vec<Vec<_>> = frames.iter().map(|f| f.iter().map(other).collect()).collect();
        let survey = Survey::of(&turned, &rig.roles, None);
        let own = Rig::of(&bvh.zero_pose(), rig.roles, &survey, None).unwrap();
        assert_eq!(own.up.to_string(), "z");
        let unit = unit_m(&turned, &own).unwrap();
        assert!((unit / unit_m(&frames, &rig).unwrap() - 2.54).abs() < 1e-6);
        let found: Vec<Pose64> = turned.iter().map(|joints| follow(joints, &own, unit)).collect();
        assert!(largest_distance(&found, &truth) < 1e-9, "{}", largest_distance(&found, &truth));
        // A mirrored file has its toes behind, until it is mirrored back.
        let mirrored: Vec<Vec<_>> =
            frames.iter().map(|f| f.iter().copied().map(reflected_joint).collect()).collect();
        let survey = Survey::of(&mirrored, &rig.roles, None);
        let error = Rig::of(&bvh.zero_pose(), rig.roles, &survey, None).unwrap_err();
        assert_eq!(error, RigError::Backwards);
    }

    #[test]
    fn standing_frames_stand_in_for_a_pose_of_offsets_that_is_no_body() {
        let file = |seed: u64| with_ends(fit_bvh(&procedural(seed), 20.0).unwrap().bvh);
        let surveyed = |bvh: Bvh| {
            let roles = rig_of(&bvh).roles;
            let survey = Survey::of(&bvh.placed(), &roles, None);
            (bvh, roles, survey)
        };
        let mut files = (0..).map(|seed| surveyed(file(seed)));
        let (bvh, roles, survey) = files.find(|(.., survey)| survey.standing >= 20).unwrap();
        let (truth, frames) = (followed(&bvh), bvh.placed());
        // All joints in one place: the pose of Bandai Namco's OFFSETs is as useless.
        let mut zero = bvh.zero_pose();
        zero.iter_mut().for_each(|joint| joint.position = [0.0; 3]);
        let rig = Rig::of(&zero, roles, &survey, None).unwrap();
        assert!(matches!(rig.neutral, Neutral::Standing(n) if n >= 10), "{:?}", rig.neutral);
        let unit = unit_m(&frames, &rig).unwrap();
        let found: Vec<Pose64> = frames.iter().map(|joints| follow(joints, &rig, unit)).collect();
        // The trunk's lean over standing frames is taken for upright.
        assert!(largest_distance(&found, &truth) < 0.25, "{}", largest_distance(&found, &truth));
        let none = Survey { standing: 9, ..survey };
        assert_eq!(Rig::of(&zero, roles, &none, None), Err(RigError::NoNeutral(9)));
    }
}
