//! Actions made of steps: walking, running, backing, sidestepping, turning.

use std::f32::consts::{PI, TAU};

use super::in_place::Wave;
use super::manner::{Manner, Posture};
use super::maths::{Draw, Drive, Side};

/// The kind of steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gait {
    Walk,
    Run,
    Back,
    /// To a side, facing ahead.
    Sideways(Side),
    /// On the spot, to a side.
    Turn(Side),
    /// Walking along an arc to a side.
    Arc(Side),
}

/// A number of alternate steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    pub gait: Gait,
    pub steps: u32,
    /// Seconds from a foot's lift to the other's.
    pub step_time: f32,
    /// Metres by which one step moves the body.
    pub step_len: f32,
    /// Radians to the left that all steps together turn the body.
    pub turn: f32,
    /// Liveliness against the mover's own usual.
    pub pace: f32,
    /// The foot that steps first.
    pub first: Side,
    /// A wave while walking.
    pub wave: Option<Wave>,
}

/// Seconds of the quickest step.
const QUICKEST: f32 = 0.275;

/// Metres per second of the fastest runner.
const FASTEST: f32 = 3.5;

/// Base step time and step length of a gait, and the fewest and most steps.
fn habits(gait: Gait) -> (f32, f32, u32, u32) {
    match gait {
        Gait::Walk => (0.53, 0.61, 2, 12),
        Gait::Arc(_) => (0.54, 0.55, 4, 14),
        Gait::Run => (0.35, 0.98, 4, 16),
        Gait::Back => (0.58, 0.4, 2, 7),
        Gait::Sideways(_) => (0.48, 0.17, 3, 10),
        Gait::Turn(_) => (0.48, 0.0, 2, 9),
    }
}

impl Travel {
    /// Draws a travel that takes no longer than `budget` seconds, if one exists.
    pub fn sample(gait: Gait, m: &Manner, budget: f32, rng: &mut impl Draw) -> Option<Self> {
        let (time, len, fewest, most) = habits(gait);
        let pace = rng.around(1.0, 0.16).max(0.62);
        // A slow body runs less slowly than it walks: below some tempo a run is none.
        let tempo = if gait == Gait::Run { m.traits.tempo.max(0.85) } else { m.traits.tempo };
        let step_time = time / (tempo * pace.sqrt() * rng.around(1.0, 0.03));
        let step_time = step_time.max(QUICKEST);
        let step_len = len * m.traits.stride * pace.sqrt() * rng.around(1.0, 0.05);
        let step_len = step_len.min(FASTEST * step_time);
        let turn = total_turn(gait, rng);
        let wanted = match gait {
            Gait::Turn(_) => fewest.max((turn.abs() / rng.uniform(0.6, 0.9)).ceil() as u32),
            // Few steps more often than many.
            _ => fewest + (rng.unit().powf(1.25) * (most - fewest + 1) as f32) as u32,
        };
        let affordable = (budget / step_time) as u32;
        // A turn of some angle takes the steps it takes; a walk may be shorter.
        let needed = (turn.abs() / 0.95).ceil() as u32;
        let steps = if needed > 1 { wanted.max(needed) } else { wanted.min(affordable) };
        if affordable < steps || steps < fewest {
            return None;
        }
        let first = match gait {
            Gait::Sideways(side) | Gait::Turn(side) => side,
            _ => m.preferred(rng),
        };
        let mut travel = Self { gait, steps, step_time, step_len, turn, pace, first, wave: None };
        if gait == Gait::Walk && rng.chance(0.12) {
            travel.wave = Wave::sample(m, travel.duration() - 0.3, rng);
        }
        Some(travel)
    }

    /// Seconds of all steps.
    pub fn duration(&self) -> f32 {
        self.steps as f32 * self.step_time
    }

    /// Metres per second.
    pub fn speed(&self) -> f32 {
        self.step_len / self.step_time
    }

    /// Share of a stride during which a foot is planted; below a half the body flies.
    pub fn duty(&self) -> f32 {
        match self.gait {
            Gait::Run => (0.42 - 0.03 * (self.speed() - 2.0)).clamp(0.34, 0.44),
            Gait::Turn(_) | Gait::Sideways(_) => 0.66,
            _ => (0.66 - 0.05 * (self.speed() - 0.8)).clamp(0.58, 0.7),
        }
    }

    /// The foot of step `i`, which may be negative.
    pub fn foot(&self, i: i32) -> Side {
        if i.rem_euclid(2) == 0 { self.first } else { self.first.other() }
    }

    /// Velocity while the steps last.
    pub fn drive(&self) -> Drive {
        let (speed, yaw) = (self.speed(), self.turn / self.duration());
        match self.gait {
            Gait::Walk | Gait::Run | Gait::Arc(_) => Drive { left: 0.0, forward: speed, yaw },
            Gait::Back => Drive { left: 0.0, forward: -speed, yaw },
            Gait::Sideways(side) => Drive { left: side.sign() * speed, forward: 0.0, yaw },
            Gait::Turn(_) => Drive { left: 0.0, forward: 0.0, yaw },
        }
    }

    /// Seconds from a standing start to full speed.
    pub fn run_up(&self) -> f32 {
        self.step_time * if self.gait == Gait::Run { 2.4 } else { 1.3 }
    }

    /// Whether `next` can follow at its full speed: this one moves the same way, half as fast.
    pub fn carries_into(&self, next: &Self) -> bool {
        let (a, b) = (self.drive(), next.drive());
        let along = a.left * b.left + a.forward * b.forward;
        2.0 * along > b.left * b.left + b.forward * b.forward
    }

    /// Amplitude of the cycle of arms and trunk, against a brisk walk's.
    fn vigour(&self) -> f32 {
        match self.gait {
            Gait::Run => (self.speed() / 2.6).clamp(0.9, 1.5),
            Gait::Turn(_) | Gait::Sideways(_) => 0.35,
            _ => (self.speed() / 1.2).clamp(0.35, 1.35),
        }
    }

    /// Takes the posture `t` seconds after the first lift, which may be negative.
    pub fn posture(&self, posture: &mut Posture, t: f32, m: &Manner) {
        let phase = PI * t / self.step_time + if self.first == Side::Left { 0.0 } else { PI };
        self.move_trunk(posture, phase, m);
        self.swing_arms(posture, phase, m);
        limp(posture, phase, m);
        if let Some(wave) = &self.wave {
            wave.raise_arms(posture, t - 0.2);
        }
    }

    /// Lead of the left leg over the right, -1 to 1.
    fn left_ahead(&self, phase: f32) -> f32 {
        let landing = TAU * (1.0 - self.duty());
        let ahead = (phase - landing).cos();
        if self.gait == Gait::Back { -ahead } else { ahead }
    }

    fn move_trunk(&self, posture: &mut Posture, phase: f32, m: &Manner) {
        let (traits, vigour, trunk) = (&m.traits, self.vigour(), &mut posture.trunk);
        let running = self.gait == Gait::Run;
        let (ahead, swing_left) = (self.left_ahead(phase), phase.sin());
        let twist = traits.twist * vigour;
        trunk.shift_left -= traits.sway * swing_left * if running { 0.4 } else { 1.0 };
        trunk.pelvis_twist -= twist * ahead;
        trunk.spine_twist += 1.7 * twist * ahead;
        trunk.head_turn -= 0.6 * twist * ahead;
        trunk.pelvis_roll -= 0.045 * vigour * swing_left;
        trunk.spine_roll += 0.05 * vigour * swing_left;
        // Highest over the planted foot in a walk, lowest there in a run.
        let over_foot = (2.0 * (phase + PI * self.duty())).cos();
        if running {
            trunk.rise -= 0.035 + (0.03 + traits.bounce) * over_foot;
            trunk.spine_pitch += 0.12 + 0.03 * self.speed();
            trunk.pelvis_pitch += 0.08;
        } else {
            trunk.rise += (traits.bounce * over_foot - 0.008) * vigour;
        }
    }

    fn swing_arms(&self, posture: &mut Posture, phase: f32, m: &Manner) {
        let running = self.gait == Gait::Run;
        let amplitude = (self.vigour() * m.traits.arm_swing).min(if running { 0.75 } else { 0.95 });
        for side in Side::BOTH {
            let forward = -side.sign() * self.left_ahead(phase);
            let arm = &mut posture.arms[side.index()];
            arm.flex += amplitude * (forward + 0.12);
            arm.elbow += amplitude * 0.45 * (forward + 0.6).max(0.0);
            if running {
                arm.elbow += (1.45 - 0.6 * m.traits.elbow).max(0.2);
                arm.flex -= 0.1;
                arm.abduct += 0.06;
            }
        }
    }
}

/// A short stance on the bad leg, into which the body sinks and over which it leans.
fn limp(posture: &mut Posture, phase: f32, m: &Manner) {
    let side = m.bad_leg.sign();
    let on_bad_leg = m.traits.limp * (-side * phase.sin()).max(0.0);
    posture.trunk.rise -= 0.045 * on_bad_leg;
    posture.trunk.spine_roll -= side * 0.16 * on_bad_leg;
    posture.trunk.spine_pitch += 0.07 * on_bad_leg;
    posture.trunk.head_pitch += 0.06 * on_bad_leg;
}

fn total_turn(gait: Gait, rng: &mut impl Draw) -> f32 {
    let degrees = match gait {
        Gait::Turn(side) => {
            let table = [(90.0, 10.0), (180.0, 7.0), (45.0, 4.0), (135.0, 2.0), (360.0, 1.2)];
            side.sign() * rng.weighted(&table) * rng.around(1.0, 0.05)
        }
        Gait::Arc(side) => {
            side.sign()
                * rng.weighted(&[(90.0, 4.0), (180.0, 3.0), (330.0, 2.0)])
                * rng.around(1.0, 0.12)
        }
        _ => rng.around(0.0, 7.0),
    };
    degrees.to_radians()
}
