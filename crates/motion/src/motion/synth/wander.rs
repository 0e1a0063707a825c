//! The noise of a living body: breath, slow wandering, and a tremor.

use super::FPS;
use super::manner::Manner;
use super::posture::{Arm, Posture, Trunk};
use super::random::Draw;

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
            breath_step: std::f32::consts::TAU * manner.breath_rate / FPS,
            breath: rng.uniform(0.0, std::f32::consts::TAU),
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
