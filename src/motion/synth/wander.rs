//! The noise of a living body: breath, slow wandering, and a tremor.

use super::FPS;
use super::manner::Manner;
use super::posture::{Arm, Posture, Trunk};
use super::random::Draw;

/// Persistence per frame of the slow noise (0.8 s) and of the fast one (0.06 s).
const SLOW: f32 = 0.939;
const FAST: f32 = 0.43;

/// One deviation of the slow noise, at wander 1.
const SLOW_TRUNK: Trunk = Trunk {
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
const SLOW_ARM: Arm = Arm { flex: 0.05, abduct: 0.035, twist: 0.09, elbow: 0.07, shrug: 0.015 };

/// The fast noise against the slow one, at wander and tremor 1.
const FAST_SHARE: f32 = 0.07;

/// First- and second-order autoregressive states of every channel, all of unit variance.
#[derive(Clone, Copy)]
struct Channels {
    drive: Posture,
    slow: Posture,
    fast: Posture,
}

/// A stream of small departures from a posture.
pub struct Wander {
    channels: Channels,
    wander: f32,
    tremor: f32,
    /// Radians per frame, and now.
    breath_step: f32,
    breath: f32,
}

impl Wander {
    /// Starts in the stationary distribution.
    pub fn new(manner: &Manner, rng: &mut impl Draw) -> Self {
        let channels = Channels { drive: white(rng), slow: white(rng), fast: white(rng) };
        Self {
            channels,
            wander: manner.traits.wander,
            tremor: manner.traits.tremor,
            breath_step: std::f32::consts::TAU * manner.breath_rate / FPS,
            breath: rng.uniform(0.0, std::f32::consts::TAU),
        }
    }

    /// The posture of the next frame with its noise.
    pub fn disturb(&mut self, posture: Posture, rng: &mut impl Draw) -> Posture {
        self.advance(rng);
        let (slow, fast) = (self.channels.slow, self.channels.fast);
        let (wander, tremor) = (self.wander, FAST_SHARE * self.tremor);
        let noise = combine(slow, fast, |s, f| wander * s + tremor * f);
        let mut noisy = Posture {
            trunk: posture.trunk.zip(noise.trunk.zip(SLOW_TRUNK, |n, a| n * a), |p, n| p + n),
            arms: [0, 1].map(|i| {
                posture.arms[i].zip(noise.arms[i].zip(SLOW_ARM, |n, a| n * a), |p, n| p + n)
            }),
        };
        self.breathe(&mut noisy);
        noisy
    }

    fn advance(&mut self, rng: &mut impl Draw) {
        let c = self.channels;
        let (innovation, echo) = ((1.0 - SLOW * SLOW).sqrt(), (1.0 - FAST * FAST).sqrt());
        // A cascade of two equal filters has this gain from the first's output.
        let gain = (1.0 - SLOW * SLOW) / (1.0 + SLOW * SLOW).sqrt();
        let drive = combine(c.drive, white(rng), |x, w| SLOW * x + innovation * w);
        let slow = combine(c.slow, drive, |x, d| SLOW * x + gain * d);
        let fast = combine(c.fast, white(rng), |x, w| FAST * x + echo * w);
        self.channels = Channels { drive, slow, fast };
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
    Posture {
        trunk: Trunk::from_fn(|| rng.white()),
        arms: [Arm::from_fn(|| rng.white()), Arm::from_fn(|| rng.white())],
    }
}

fn combine(a: Posture, b: Posture, f: impl Fn(f32, f32) -> f32 + Copy) -> Posture {
    Posture {
        trunk: a.trunk.zip(b.trunk, f),
        arms: [a.arms[0].zip(b.arms[0], f), a.arms[1].zip(b.arms[1], f)],
    }
}
