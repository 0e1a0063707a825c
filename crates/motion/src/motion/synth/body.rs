//! A script into joints: forward kinematics for the trunk and the arms, two-bone inverse kinematics for the
//! legs, and the noise of a living body.

use std::f32::consts::TAU;
use std::sync::LazyLock;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::feet::Foot;
use super::manner::{Arm, Manner, Posture, Trunk};
use super::maths::{Blend, Draw, FPS, FloorPose, Rotation, Side, V3, norm, unit};
use super::path::{Path, footsteps};
use super::script::Script;
use crate::motion::geometry::{add, cross, scale, sub};
use crate::motion::{BONE_LENGTHS as BONES, N_JOINTS, Pose};

impl Script {
    /// The joints, `n_frames + 1` poses at [`FPS`] frames per second, metres; the script's own noise
    /// seed decides all.
    pub fn poses(&self) -> Vec<Pose> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.noise);
        let path = Path::lay(self, &mut rng);
        let mut feet = footsteps(self, &path, &mut rng);
        let mut wander = Wander::new(&self.manner, &mut rng);
        let frame_pose = |frame: usize| {
            let t = frame as f32 / FPS;
            let posture = wander.disturb(self.posture(t), &mut rng);
            pose(path.at(t), &posture, &[feet[0].at(t), feet[1].at(t)])
        };
        (0..=self.n_frames()).map(frame_pose).collect()
    }
}

// Joints from a root, a posture and two feet.

/// Direction of the bones that keep theirs relative to the parent's frame, standing upright.
const DIRECTIONS: [(usize, V3); 11] = [
    (1, [0.57, -0.79, -0.2]),
    (2, [-0.57, -0.79, -0.2]),
    (3, [0.0, 0.97, -0.22]),
    (6, [0.0, 1.0, 0.0]),
    (9, [0.0, 0.92, 0.38]),
    (12, [0.0, 0.98, -0.19]),
    (13, [0.55, 0.83, -0.1]),
    (14, [-0.55, 0.83, -0.1]),
    (15, [0.0, 0.87, 0.5]),
    (16, [0.93, 0.33, -0.14]),
    (17, [-0.93, 0.33, -0.14]),
];

static OFFSETS: LazyLock<[V3; N_JOINTS]> = LazyLock::new(|| {
    let mut offsets = [[0.0; 3]; N_JOINTS];
    for (joint, direction) in DIRECTIONS {
        offsets[joint] = scale(unit(direction), BONES[joint]);
    }
    offsets
});

/// Height of the pelvis of an upright body with its legs all but straight.
pub const UPRIGHT: f32 = 0.978;

/// The share of a leg's length that a planted leg may use; a straight knee would snap.
const REACH: f32 = 0.992;

/// The joints of a body with its root at `root`.
pub fn pose(root: FloorPose, posture: &Posture, feet: &[Foot; 2]) -> Pose {
    let trunk = &posture.trunk;
    let yaw = root.yaw + trunk.pelvis_twist;
    let pelvis_rotation = Rotation::yxz(yaw, trunk.pelvis_pitch, trunk.pelvis_roll);
    let hips = [1, 2].map(|joint| pelvis_rotation.of(OFFSETS[joint]));
    let ground = root.offset(trunk.shift_left, trunk.shift_forward);
    let height = pelvis_height(ground, UPRIGHT + trunk.rise, &hips, feet);
    let mut joints = [[0.0; 3]; N_JOINTS];
    joints[0] = [ground.x, height, ground.z];
    let chest = place_spine(&mut joints, trunk, pelvis_rotation);
    for side in Side::BOTH {
        let i = side.index();
        let hip = add(joints[0], hips[i]);
        place_leg(&mut joints, side, hip, yaw, &feet[i]);
        place_arm(&mut joints, side, &posture.arms[i], chest);
    }
    joints
}

/// The requested height, limited by both legs, with a smooth transition.
fn pelvis_height(ground: FloorPose, wanted: f32, hips: &[V3; 2], feet: &[Foot; 2]) -> f32 {
    Side::BOTH.iter().fold(wanted, |height, &side| {
        let (hip, foot) = (hips[side.index()], &feet[side.index()]);
        let (thigh, shin) = leg_bones(side);
        let reach = REACH * (thigh + shin);
        let dx = ground.x + hip[0] - foot.ankle[0];
        let dz = ground.z + hip[2] - foot.ankle[2];
        let above = (reach * reach - dx * dx - dz * dz).max(0.09).sqrt();
        // A foot in the air can follow the body, so it binds less.
        let limit = foot.ankle[1] - hip[1] + above + 0.25 * foot.airborne;
        smooth_min(height, limit)
    })
}

fn smooth_min(a: f32, b: f32) -> f32 {
    let d = a - b;
    0.5 * (a + b - (d * d + 0.015 * 0.015).sqrt())
}

fn leg_bones(side: Side) -> (f32, f32) {
    (BONES[4 + side.index()], BONES[7 + side.index()])
}

/// Hip, knee, ankle and foot of one side; the knee bends about an axis half-way between the
/// pelvis's and the foot's.
fn place_leg(joints: &mut Pose, side: Side, hip: V3, pelvis_yaw: f32, foot: &Foot) {
    let i = side.index();
    let (thigh, shin) = leg_bones(side);
    let (s, c) = (0.5 * (pelvis_yaw + foot.yaw)).sin_cos();
    let (knee, ankle) = bend(hip, foot.ankle, thigh, shin, [c, 0.0, -s]);
    joints[1 + i] = hip;
    joints[4 + i] = knee;
    joints[7 + i] = ankle;
    joints[10 + i] = add(ankle, foot.toe_offset(BONES[10 + i]));
}

/// Middle and end of a two-bone chain from `start` towards `target`, as near as it reaches.
fn bend(start: V3, target: V3, upper: f32, lower: f32, axis: V3) -> (V3, V3) {
    let wanted = sub(target, start);
    let distance = norm(wanted).clamp(0.3, 0.998 * (upper + lower));
    let direction = unit(wanted);
    let along = (upper * upper + distance * distance - lower * lower) / (2.0 * distance);
    let aside = (upper * upper - along * along).max(0.0).sqrt();
    let forward = unit(cross(direction, axis));
    let middle = add(start, add(scale(direction, along), scale(forward, aside)));
    (middle, add(start, scale(direction, distance)))
}

/// Spine, neck, head, collars and shoulders' frame; returns the chest's rotation.
fn place_spine(joints: &mut Pose, trunk: &Trunk, pelvis: Rotation) -> Rotation {
    let third =
        Rotation::yxz(trunk.spine_twist / 3.0, trunk.spine_pitch / 3.0, trunk.spine_roll / 3.0);
    let lower = pelvis.after(third);
    let middle = lower.after(third);
    let chest = middle.after(third);
    joints[3] = add(joints[0], pelvis.of(OFFSETS[3]));
    joints[6] = add(joints[3], lower.of(OFFSETS[6]));
    joints[9] = add(joints[6], middle.of(OFFSETS[9]));
    joints[12] = add(joints[9], chest.of(OFFSETS[12]));
    let head = Rotation::yxz(trunk.head_turn, trunk.head_pitch, trunk.head_roll);
    joints[15] = add(joints[12], chest.after(head).of(OFFSETS[15]));
    chest
}

/// Collar, shoulder, elbow and wrist of one side.
fn place_arm(joints: &mut Pose, side: Side, arm: &Arm, chest: Rotation) {
    let (i, sign) = (side.index(), side.sign());
    let raised = chest.after(Rotation::z(sign * arm.shrug));
    let collar = add(joints[9], raised.of(OFFSETS[13 + i]));
    let shoulder = add(collar, raised.of(OFFSETS[16 + i]));
    let upper = chest
        .after(Rotation::x(-arm.flex))
        .after(Rotation::z(sign * arm.abduct))
        .after(Rotation::y(sign * arm.twist));
    let elbow = add(shoulder, upper.of([0.0, -BONES[18 + i], 0.0]));
    let (s, c) = arm.elbow.sin_cos();
    let forearm = upper.of([0.0, -BONES[20 + i] * c, BONES[20 + i] * s]);
    joints[13 + i] = collar;
    joints[16 + i] = shoulder;
    joints[18 + i] = elbow;
    joints[20 + i] = add(elbow, forearm);
}

// Noise: breath, slow wandering, and a tremor.

/// Persistence per frame of the slow noise (0.8 s) and of the fast one (0.06 s).
const SLOW: f32 = 0.939;
const FAST: f32 = 0.43;

/// One deviation of the slow noise, at wander 1.
const DEVIATION: Posture = {
    let trunk = Trunk {
        shift_left: 0.009,
        rise: 0.003,
        shift_forward: 0.007,
        pelvis_pitch: 0.018,
        pelvis_roll: 0.014,
        pelvis_twist: 0.03,
        spine_pitch: 0.03,
        spine_roll: 0.025,
        spine_twist: 0.035,
        head_pitch: 0.05,
        head_roll: 0.03,
        head_turn: 0.11,
    };
    let arm = Arm { flex: 0.05, abduct: 0.035, twist: 0.09, elbow: 0.07, shrug: 0.015 };
    Posture { trunk, arms: [arm; 2] }
};

/// The fast noise against the slow one, at wander and tremor 1.
const FAST_SHARE: f32 = 0.07;

/// A stream of small departures from a posture.
pub struct Wander {
    /// First- and second-order autoregressive states of every channel, all of unit variance.
    drive: Posture,
    slow: Posture,
    fast: Posture,
    wander: f32,
    tremor: f32,
    /// Radians per frame, and now.
    breath_step: f32,
    breath: f32,
}

impl Wander {
    /// Starts in the stationary distribution.
    pub fn new(manner: &Manner, rng: &mut impl Draw) -> Self {
        Self {
            drive: white(rng),
            slow: white(rng),
            fast: white(rng),
            wander: manner.traits.wander,
            tremor: manner.traits.tremor,
            breath_step: TAU * manner.breath_rate / FPS,
            breath: rng.uniform(0.0, TAU),
        }
    }

    /// The posture of the next frame with its noise.
    pub fn disturb(&mut self, posture: Posture, rng: &mut impl Draw) -> Posture {
        self.advance(rng);
        let (wander, tremor) = (self.wander, FAST_SHARE * self.tremor);
        let noise = self.slow.zip(self.fast, |s, f| wander * s + tremor * f);
        let mut noisy = posture.zip(noise.zip(DEVIATION, |n, a| n * a), |p, n| p + n);
        self.breathe(&mut noisy);
        noisy
    }

    fn advance(&mut self, rng: &mut impl Draw) {
        let (innovation, echo) = ((1.0 - SLOW * SLOW).sqrt(), (1.0 - FAST * FAST).sqrt());
        // A cascade of two equal filters has this gain from the first's output.
        let gain = (1.0 - SLOW * SLOW) / (1.0 + SLOW * SLOW).sqrt();
        self.drive = self.drive.zip(white(rng), |x, w| SLOW * x + innovation * w);
        self.slow = self.slow.zip(self.drive, |x, d| SLOW * x + gain * d);
        self.fast = self.fast.zip(white(rng), |x, w| FAST * x + echo * w);
    }

    fn breathe(&mut self, posture: &mut Posture) {
        self.breath += self.breath_step;
        let breath = self.breath.sin();
        posture.trunk.spine_pitch -= 0.012 * breath;
        for arm in &mut posture.arms {
            arm.shrug += 0.015 * breath;
            arm.elbow = arm.elbow.max(0.03);
        }
    }
}

fn white(rng: &mut impl Draw) -> Posture {
    Posture::from_fn(|| rng.white())
}
