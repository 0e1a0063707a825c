//! What a body does relative to its root: angles and offsets, without feet.

use super::floor::Side;
use super::manner::Manner;

blendable! {
    /// Pelvis, spine and head.
    pub struct Trunk {
        /// Metres by which the pelvis is left of the root.
        shift_left,
        /// Metres by which the pelvis is above its upright height.
        rise,
        /// Metres by which the pelvis is ahead of the root.
        shift_forward,
        pelvis_pitch,
        pelvis_roll,
        pelvis_twist,
        spine_pitch,
        spine_roll,
        spine_twist,
        head_pitch,
        head_roll,
        head_turn,
    }
}

blendable! {
    /// One arm. At zero it hangs straight down, the elbow bends the forearm forward.
    pub struct Arm {
        /// Raise forward.
        flex,
        /// Raise to the arm's own side.
        abduct,
        /// Turn about the upper arm, outward.
        twist,
        /// Bend of the elbow.
        elbow,
        /// Raise of the shoulder.
        shrug,
    }
}

/// Trunk and arms of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posture {
    pub trunk: Trunk,
    /// Left, right.
    pub arms: [Arm; 2],
}

impl Posture {
    /// Standing at ease, in a manner.
    pub fn idle(manner: &Manner) -> Self {
        let m = &manner.traits;
        let trunk = Trunk {
            rise: -m.crouch,
            pelvis_pitch: 0.35 * m.lean,
            spine_pitch: m.lean,
            head_pitch: m.head,
            shift_forward: -0.12 * m.lean,
            ..Trunk::from_fn(|| 0.0)
        };
        let flex = 0.06 - 0.5 * m.lean;
        let arm = Arm { flex, abduct: m.abduct, twist: -0.3, elbow: m.elbow, shrug: m.shrug };
        Self { trunk, arms: [arm; 2] }
    }

    /// Fills trunk, left arm and right arm.
    pub fn from_fn(mut value: impl FnMut() -> f32) -> Self {
        let trunk = Trunk::from_fn(&mut value);
        Self { trunk, arms: [Arm::from_fn(&mut value), Arm::from_fn(&mut value)] }
    }

    /// Combines two postures number by number.
    pub fn zip(self, other: Self, combine: impl Fn(f32, f32) -> f32) -> Self {
        let arms = [0, 1].map(|i| self.arms[i].zip(other.arms[i], &combine));
        Self { trunk: self.trunk.zip(other.trunk, &combine), arms }
    }

    /// `self` at weight 0, `other` at weight 1.
    pub fn mix(self, other: Self, weight: f32) -> Self {
        let arms = [0, 1].map(|i| self.arms[i].mix(other.arms[i], weight));
        Self { trunk: self.trunk.mix(other.trunk, weight), arms }
    }

    /// The arm of a side, to change.
    pub fn arm(&mut self, side: Side) -> &mut Arm {
        &mut self.arms[side.index()]
    }

    /// Moves the arms of some sides towards a target.
    pub fn reach(&mut self, sides: impl IntoIterator<Item = Side>, target: Arm, weight: f32) {
        for side in sides {
            let arm = self.arm(side);
            *arm = arm.mix(target, weight);
        }
    }
}
