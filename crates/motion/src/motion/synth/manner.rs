//! Styles of moving with their words, personal habits, and the relaxed posture in a style.

use super::maths::{Blend, Draw, Side};

/// Everything about the mover that lasts for the clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manner {
    pub style: &'static Style,
    /// How strongly the style shows: below 0.75 slight, above 1.1 strong.
    pub strength: f32,
    pub traits: Traits,
    /// The hand and foot that acts by preference.
    pub dominant: Side,
    /// The leg that a limp favours.
    pub bad_leg: Side,
    /// Breaths per second.
    pub breath_rate: f32,
}

impl Manner {
    /// Draws a style and a person.
    pub fn sample(rng: &mut impl Draw) -> Self {
        let style = rng.weighted(STYLES);
        let strength = rng.uniform(0.5, 1.3);
        let own = BETWEEN_PEOPLE.zip(Traits::from_fn(|| rng.around(0.0, 1.0)), |sd, z| sd * z);
        let traits = PLAIN.mix(style.traits, strength).zip(own, |a, b| a + b);
        Self {
            style,
            strength,
            traits: bounded(traits),
            dominant: if rng.chance(0.88) { Side::Right } else { Side::Left },
            bad_leg: rng.one_of(&Side::BOTH),
            breath_rate: rng.uniform(0.2, 0.35),
        }
    }

    /// Draws a side for an action, mostly the dominant one.
    pub fn preferred(&self, rng: &mut impl Draw) -> Side {
        if rng.chance(0.8) { self.dominant } else { self.dominant.other() }
    }
}

/// Traits that are sizes stay positive, and no body stands lower than its legs bend well.
fn bounded(traits: Traits) -> Traits {
    Traits {
        arm_swing: traits.arm_swing.max(0.0),
        elbow: traits.elbow.max(0.05),
        abduct: traits.abduct.max(0.02),
        crouch: traits.crouch.clamp(0.0, 0.18),
        twist: traits.twist.max(0.0),
        sway: traits.sway.max(0.0),
        bounce: traits.bounce.max(0.0),
        lift: traits.lift.max(0.3),
        wander: traits.wander.max(0.05),
        tremor: traits.tremor.max(0.05),
        ..traits
    }
}

// Styles of moving, and their effect on a body.

/// Declares the traits, each with its value in the plain style and one deviation between people.
macro_rules! traits {
    ($($(#[$meta:meta])* $field:ident: $plain:expr, $between_people:expr;)*) => {
        blendable! {
            /// How a body moves, in numbers that last for a whole clip.
            pub struct Traits { $($(#[$meta])* $field,)* }
        }

        /// The traits of the plain style.
        pub const PLAIN: Traits = Traits { $($field: $plain,)* };

        /// One deviation of each trait between people.
        pub const BETWEEN_PEOPLE: Traits = Traits { $($field: $between_people,)* };
    };
}

traits! {
    /// Steps per second, relative to a usual walker's.
    tempo: 1.0, 0.06;
    /// Step length, relative to a usual walker's.
    stride: 1.0, 0.07;
    /// Amplitude of the arms' swing.
    arm_swing: 0.42, 0.09;
    /// Bend of the elbows at rest.
    elbow: 0.25, 0.1;
    /// Angle between arms and trunk at rest.
    abduct: 0.14, 0.04;
    /// Forward bend of the spine.
    lean: 0.04, 0.035;
    /// Nod of the head.
    head: 0.05, 0.06;
    /// Metres by which the pelvis is lower than upright.
    crouch: 0.01, 0.006;
    /// Raise of the shoulders.
    shrug: 0.0, 0.025;
    /// Metres between a foot and the middle.
    width: 0.085, 0.008;
    /// Outward turn of the feet.
    toe_out: 0.12, 0.06;
    /// Metres of sideways sway in a step.
    sway: 0.025, 0.006;
    /// Turn of the pelvis in a step.
    twist: 0.09, 0.025;
    /// Extra rise and fall in a step, in metres.
    bounce: 0.008, 0.003;
    /// How high feet are lifted, relative to a usual walker's.
    lift: 1.0, 0.15;
    /// Slow noise, relative to a usual body's.
    wander: 1.0, 0.15;
    /// Fast noise, relative to a usual body's.
    tremor: 1.0, 0.15;
    /// How lame the bad leg is.
    limp: 0.0, 0.0;
    /// Speed of everything but steps, relative to a usual body's.
    energy: 1.0, 0.07;
}

/// A way of moving.
#[derive(Debug, PartialEq)]
pub struct Style {
    /// Adjectives and adverbs for it, pair by pair; none for the plain style.
    pub words: &'static [(&'static str, &'static str)],
    /// Its effect on a body at full strength.
    pub traits: Traits,
}

/// Declares the styles: weight, words, and the traits that differ from the plain style.
macro_rules! styles {
    ($($weight:literal, $words:expr, { $($field:ident: $value:expr),* };)*) => {
        /// The styles with their weights: roughly Zipf's law with the plain style first.
        pub const STYLES: &[(&Style, f32)] = &[$({
            const STYLE: Style =
                Style { words: $words, traits: Traits { $($field: $value,)* ..PLAIN } };
            (&STYLE, $weight)
        },)*];
    };
}

styles! {
    10.0, &[], {};
    4.0, &[("happy", "happily"), ("cheerful", "cheerfully"), ("joyful", "joyfully")], {
        tempo: 1.12, stride: 1.08, arm_swing: 0.65, elbow: 0.45, head: -0.08, twist: 0.14,
        bounce: 0.025, lift: 1.25, energy: 1.15
    };
    3.0, &[("tired", "tiredly"), ("exhausted", "wearily"), ("weary", "wearily")], {
        tempo: 0.8, stride: 0.75, arm_swing: 0.2, lean: 0.3, head: 0.24, crouch: 0.05,
        sway: 0.04, lift: 0.6, wander: 1.3, energy: 0.72
    };
    2.3, &[("sad", "sadly"), ("gloomy", "gloomily"), ("depressed", "sadly")], {
        tempo: 0.83, stride: 0.8, arm_swing: 0.14, abduct: 0.07, lean: 0.2, head: 0.36,
        shrug: 0.08, energy: 0.78
    };
    1.9, &[("angry", "angrily"), ("furious", "furiously"), ("mad", "angrily")], {
        tempo: 1.18, stride: 1.1, arm_swing: 0.6, elbow: 0.75, abduct: 0.28, lean: 0.15,
        shrug: 0.12, tremor: 1.6, energy: 1.32
    };
    1.6, &[("proud", "proudly"), ("confident", "confidently")], {
        tempo: 0.92, stride: 1.12, lean: -0.12, head: -0.14, abduct: 0.26, shrug: -0.05,
        toe_out: 0.24
    };
    1.4, &[("sneaky", "sneakily"), ("stealthy", "stealthily")], {
        tempo: 0.72, stride: 0.85, arm_swing: 0.2, elbow: 1.15, abduct: 0.32, lean: 0.42,
        head: -0.12, crouch: 0.13, lift: 2.0, energy: 0.78
    };
    1.2, &[("limping", "with a limp"), ("injured", "lamely")], {
        limp: 1.0, tempo: 0.86, stride: 0.76, sway: 0.04
    };
    1.0, &[("drunk", "drunkenly"), ("dizzy", "unsteadily")], {
        tempo: 0.85, stride: 0.9, abduct: 0.32, width: 0.12, sway: 0.06, toe_out: 0.25,
        wander: 2.8
    };
    0.9, &[("nervous", "nervously"), ("anxious", "anxiously")], {
        tempo: 1.14, stride: 0.75, arm_swing: 0.14, elbow: 1.0, abduct: 0.06, shrug: 0.18,
        head: 0.12, wander: 1.6, tremor: 2.8
    };
    0.8, &[("old", "feebly"), ("elderly", "like an old person")], {
        tempo: 0.78, stride: 0.6, elbow: 0.8, lean: 0.42, head: -0.15, crouch: 0.07, lift: 0.5,
        tremor: 2.2, energy: 0.66
    };
    0.7, &[("energetic", "energetically"), ("lively", "with energy")], {
        tempo: 1.22, stride: 1.14, arm_swing: 0.8, elbow: 0.8, bounce: 0.03, lift: 1.4,
        energy: 1.4
    };
    0.5, &[("robotic", "like a robot"), ("stiff", "stiffly")], {
        tempo: 0.9, sway: 0.005, twist: 0.0, bounce: 0.0, wander: 0.15, tremor: 0.2, elbow: 1.2,
        lift: 1.3
    };
}

// Posture relative to the root: angles and offsets, without feet.

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
            ..Trunk::default()
        };
        let flex = 0.06 - 0.5 * m.lean;
        let arm = Arm { flex, abduct: m.abduct, twist: -0.3, elbow: m.elbow, shrug: m.shrug };
        Self { trunk, arms: [arm; 2] }
    }

    /// Moves the arms of some sides towards a target.
    pub fn reach(&mut self, sides: impl IntoIterator<Item = Side>, target: Arm, weight: f32) {
        for side in sides {
            let arm = &mut self.arms[side.index()];
            *arm = arm.mix(target, weight);
        }
    }
}

impl Blend for Posture {
    fn from_fn(mut value: impl FnMut() -> f32) -> Self {
        let trunk = Trunk::from_fn(&mut value);
        Self { trunk, arms: [Arm::from_fn(&mut value), Arm::from_fn(&mut value)] }
    }

    fn zip(self, other: Self, combine: impl Fn(f32, f32) -> f32) -> Self {
        let arms = [0, 1].map(|i| self.arms[i].zip(other.arms[i], &combine));
        Self { trunk: self.trunk.zip(other.trunk, &combine), arms }
    }
}
