//! Styles of moving: what they do to a body, and the words for them.

use super::random::Draw;

blendable! {
    /// How a body moves, in numbers that last for a whole clip.
    pub struct Traits {
        /// Steps per second, relative to a usual walker's.
        tempo,
        /// Step length, relative to a usual walker's.
        stride,
        /// Amplitude of the arms' swing.
        arm_swing,
        /// Bend of the elbows at rest.
        elbow,
        /// Angle between arms and trunk at rest.
        abduct,
        /// Forward bend of the spine.
        lean,
        /// Nod of the head.
        head,
        /// Metres by which the pelvis is lower than upright.
        crouch,
        /// Raise of the shoulders.
        shrug,
        /// Metres between a foot and the middle.
        width,
        /// Outward turn of the feet.
        toe_out,
        /// Metres of sideways sway in a step.
        sway,
        /// Turn of the pelvis in a step.
        twist,
        /// Metres of rise and fall in a step, beyond what the legs ask for.
        bounce,
        /// How high feet are lifted, relative to a usual walker's.
        lift,
        /// Slow noise, relative to a usual body's.
        wander,
        /// Fast noise, relative to a usual body's.
        tremor,
        /// How lame the bad leg is.
        limp,
        /// Speed of everything but steps, relative to a usual body's.
        energy,
    }
}

const PLAIN: Traits = Traits {
    tempo: 1.0,
    stride: 1.0,
    arm_swing: 0.42,
    elbow: 0.25,
    abduct: 0.14,
    lean: 0.04,
    head: 0.05,
    crouch: 0.01,
    shrug: 0.0,
    width: 0.085,
    toe_out: 0.12,
    sway: 0.025,
    twist: 0.09,
    bounce: 0.008,
    lift: 1.0,
    wander: 1.0,
    tremor: 1.0,
    limp: 0.0,
    energy: 1.0,
};

/// One deviation of each trait between people.
pub const BETWEEN_PEOPLE: Traits = Traits {
    tempo: 0.06,
    stride: 0.07,
    arm_swing: 0.09,
    elbow: 0.1,
    abduct: 0.04,
    lean: 0.035,
    head: 0.06,
    crouch: 0.006,
    shrug: 0.025,
    width: 0.008,
    toe_out: 0.06,
    sway: 0.006,
    twist: 0.025,
    bounce: 0.003,
    lift: 0.15,
    wander: 0.15,
    tremor: 0.15,
    limp: 0.0,
    energy: 0.07,
};

/// A named way of moving.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    Plain,
    Happy,
    Tired,
    Sad,
    Angry,
    Proud,
    Sneaky,
    Limping,
    Drunk,
    Nervous,
    Elderly,
    Energetic,
    Robotic,
}

/// Roughly Zipf's law with the plain style first.
const WEIGHTS: [(Style, f32); 13] = [
    (Style::Plain, 10.0),
    (Style::Happy, 4.0),
    (Style::Tired, 3.0),
    (Style::Sad, 2.3),
    (Style::Angry, 1.9),
    (Style::Proud, 1.6),
    (Style::Sneaky, 1.4),
    (Style::Limping, 1.2),
    (Style::Drunk, 1.0),
    (Style::Nervous, 0.9),
    (Style::Elderly, 0.8),
    (Style::Energetic, 0.7),
    (Style::Robotic, 0.5),
];

impl Style {
    /// Draws a style, common ones often.
    pub fn sample(rng: &mut impl Draw) -> Self {
        rng.weighted(&WEIGHTS)
    }

    /// Adjectives and adverbs for it, pair by pair; none for the plain style.
    pub fn words(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Style::Plain => &[],
            Style::Happy => {
                &[("happy", "happily"), ("cheerful", "cheerfully"), ("joyful", "joyfully")]
            }
            Style::Tired => &[("tired", "tiredly"), ("exhausted", "wearily"), ("weary", "wearily")],
            Style::Sad => &[("sad", "sadly"), ("gloomy", "gloomily"), ("depressed", "sadly")],
            Style::Angry => &[("angry", "angrily"), ("furious", "furiously"), ("mad", "angrily")],
            Style::Proud => &[("proud", "proudly"), ("confident", "confidently")],
            Style::Sneaky => &[("sneaky", "sneakily"), ("stealthy", "stealthily")],
            Style::Limping => &[("limping", "with a limp"), ("injured", "lamely")],
            Style::Drunk => &[("drunk", "drunkenly"), ("dizzy", "unsteadily")],
            Style::Nervous => &[("nervous", "nervously"), ("anxious", "anxiously")],
            Style::Elderly => &[("old", "feebly"), ("elderly", "like an old person")],
            Style::Energetic => &[("energetic", "energetically"), ("lively", "with energy")],
            Style::Robotic => &[("robotic", "like a robot"), ("stiff", "stiffly")],
        }
    }

    /// What the style, at full strength, does to a body.
    pub fn traits(self) -> Traits {
        match self {
            Style::Plain | Style::Happy | Style::Energetic | Style::Proud | Style::Robotic => {
                self.upright()
            }
            Style::Tired | Style::Sad | Style::Elderly | Style::Limping | Style::Drunk => {
                self.weak()
            }
            Style::Angry | Style::Sneaky | Style::Nervous => self.tense(),
        }
    }

    fn upright(self) -> Traits {
        let p = PLAIN;
        match self {
            Style::Happy => Traits {
                tempo: 1.12,
                stride: 1.08,
                arm_swing: 0.65,
                elbow: 0.45,
                head: -0.08,
                twist: 0.14,
                bounce: 0.025,
                lift: 1.25,
                energy: 1.15,
                ..p
            },
            Style::Energetic => Traits {
                tempo: 1.22,
                stride: 1.14,
                arm_swing: 0.8,
                elbow: 0.8,
                bounce: 0.03,
                lift: 1.4,
                energy: 1.4,
                ..p
            },
            Style::Proud => Traits {
                tempo: 0.92,
                stride: 1.12,
                lean: -0.12,
                head: -0.14,
                abduct: 0.26,
                shrug: -0.05,
                toe_out: 0.24,
                ..p
            },
            Style::Robotic => Traits {
                tempo: 0.9,
                sway: 0.005,
                twist: 0.0,
                bounce: 0.0,
                wander: 0.15,
                tremor: 0.2,
                elbow: 1.2,
                lift: 1.3,
                ..p
            },
            _ => p,
        }
    }

    fn weak(self) -> Traits {
        let p = PLAIN;
        match self {
            Style::Tired => Traits {
                tempo: 0.8,
                stride: 0.75,
                arm_swing: 0.2,
                lean: 0.3,
                head: 0.24,
                crouch: 0.05,
                sway: 0.04,
                lift: 0.6,
                wander: 1.3,
                energy: 0.72,
                ..p
            },
            Style::Sad => Traits {
                tempo: 0.83,
                stride: 0.8,
                arm_swing: 0.14,
                abduct: 0.07,
                lean: 0.2,
                head: 0.36,
                shrug: 0.08,
                energy: 0.78,
                ..p
            },
            Style::Elderly => Traits {
                tempo: 0.78,
                stride: 0.6,
                elbow: 0.8,
                lean: 0.42,
                head: -0.15,
                crouch: 0.07,
                lift: 0.5,
                tremor: 2.2,
                energy: 0.66,
                ..p
            },
            Style::Drunk => Traits {
                tempo: 0.85,
                stride: 0.9,
                abduct: 0.32,
                width: 0.12,
                sway: 0.06,
                toe_out: 0.25,
                wander: 2.8,
                ..p
            },
            _ => Traits { limp: 1.0, tempo: 0.86, stride: 0.76, sway: 0.04, ..p },
        }
    }

    fn tense(self) -> Traits {
        let p = PLAIN;
        match self {
            Style::Angry => Traits {
                tempo: 1.18,
                stride: 1.1,
                arm_swing: 0.6,
                elbow: 0.75,
                abduct: 0.28,
                lean: 0.15,
                shrug: 0.12,
                tremor: 1.6,
                energy: 1.32,
                ..p
            },
            Style::Sneaky => Traits {
                tempo: 0.72,
                stride: 0.85,
                arm_swing: 0.2,
                elbow: 1.15,
                abduct: 0.32,
                lean: 0.42,
                head: -0.12,
                crouch: 0.13,
                lift: 2.0,
                energy: 0.78,
                ..p
            },
            _ => Traits {
                tempo: 1.14,
                stride: 0.75,
                arm_swing: 0.14,
                elbow: 1.0,
                abduct: 0.06,
                shrug: 0.18,
                head: 0.12,
                wander: 1.6,
                tremor: 2.8,
                ..p
            },
        }
    }
}
