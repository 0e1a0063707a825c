//! Actions on planted feet: of the hands, stretching, bowing, squatting, sitting, standing.

use std::f32::consts::{PI, TAU};

use super::manner::{Arm, Manner, Posture};
use super::maths::{Blend, Draw, Side, plateau, smooth};

/// Seconds in which an arm is raised or lowered, at energy 1.
const RAISE: f32 = 0.55;

/// Seconds in which fists are raised or lowered.
const GUARD: f32 = 0.35;

/// A movement done `count` times, `period` seconds each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeats {
    pub count: u32,
    pub period: f32,
}

impl Repeats {
    /// Draws a count, small ones often, that fits `budget` seconds.
    pub fn sample(
        counts: (u32, u32),
        period: f32,
        budget: f32,
        rng: &mut impl Draw,
    ) -> Option<Self> {
        let span = (counts.1 - counts.0 + 1) as f32;
        let count = counts.0 + (rng.unit().powf(1.4) * span) as u32;
        let count = count.min((budget.max(0.0) / period) as u32);
        (count >= counts.0).then_some(Self { count, period })
    }

    /// Seconds of all repeats.
    pub fn total(&self) -> f32 {
        self.count as f32 * self.period
    }

    /// Seconds from the start of the repeat that goes on at `t`, the first before all and the last after.
    pub fn since_start(&self, t: f32) -> f32 {
        t.clamp(0.0, self.total() - 1e-4).rem_euclid(self.period)
    }
}

/// The hands that act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hands {
    One(Side),
    Both,
}

impl Hands {
    fn sample(m: &Manner, both: f32, rng: &mut impl Draw) -> Self {
        if rng.chance(both) { Hands::Both } else { Hands::One(m.preferred(rng)) }
    }

    /// Whether the hand of this side takes part.
    pub fn uses(self, side: Side) -> bool {
        matches!(self, Hands::Both) || self == Hands::One(side)
    }
}

/// Waving one or both hands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    pub hands: Hands,
    pub repeats: Repeats,
    /// 0 at the chest, 1 above the head.
    pub height: f32,
    /// Radians of the forearm's swing.
    pub swing: f32,
    pub raise: f32,
}

impl Wave {
    /// Draws a wave of at most `budget` seconds, if one fits.
    pub fn sample(m: &Manner, budget: f32, rng: &mut impl Draw) -> Option<Self> {
        let energy = m.traits.energy;
        let raise = RAISE / energy * rng.uniform(0.85, 1.2);
        let period = rng.uniform(0.42, 0.75) / energy;
        let repeats = Repeats::sample((2, 7), period, budget - 2.0 * raise, rng)?;
        let height = rng.uniform(0.0, 1.0);
        let swing = rng.uniform(0.25, 0.6) * energy.sqrt();
        Some(Self { hands: Hands::sample(m, 0.13, rng), repeats, height, swing, raise })
    }

    /// Seconds from the hand's rise to its rest.
    pub fn duration(&self) -> f32 {
        2.0 * self.raise + self.repeats.total()
    }

    /// Moves the arms of a posture to the wave `t` seconds after its start.
    pub fn raise_arms(&self, posture: &mut Posture, t: f32) {
        let up = plateau(t, self.duration(), self.raise);
        let cycle = TAU * (t - self.raise) / self.repeats.period;
        let swing = self.swing * cycle.sin() * up;
        let low = Arm { flex: 0.2, abduct: 0.75, twist: 0.95, elbow: 2.05, shrug: 0.05 };
        let high = Arm { flex: 0.0, abduct: 2.35, twist: 1.35, elbow: 0.75, shrug: 0.3 };
        let mut target = low.mix(high, self.height);
        target.elbow -= swing;
        target.abduct += 0.15 * swing;
        let hands = Side::BOTH.into_iter().filter(|&side| self.hands.uses(side));
        posture.reach(hands, target, up);
    }
}

/// Punching at the air ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Punch {
    pub first: Side,
    /// Left and right in turn.
    pub alternates: bool,
    pub repeats: Repeats,
    /// Raise of the striking arm.
    pub aim: f32,
}

impl Punch {
    /// Draws punches of at most `budget` seconds, if any fit.
    pub fn sample(m: &Manner, budget: f32, rng: &mut impl Draw) -> Option<Self> {
        let period = rng.uniform(0.5, 0.8) / m.traits.energy;
        Some(Self {
            first: m.preferred(rng),
            alternates: rng.chance(0.5),
            repeats: Repeats::sample((1, 6), period, budget - 2.0 * GUARD, rng)?,
            aim: rng.uniform(1.15, 1.75),
        })
    }

    /// Seconds from the rise of the fists to their fall.
    pub fn duration(&self) -> f32 {
        2.0 * GUARD + self.repeats.total()
    }

    /// Moves arms and trunk of a posture to the punches `t` seconds after their start.
    pub fn strike(&self, posture: &mut Posture, t: f32) {
        let on = plateau(t, self.duration(), GUARD);
        let (striking, strike) = self.thrown(t - GUARD);
        let guard = Arm { flex: 0.75, abduct: 0.12, twist: -0.25, elbow: 2.1, shrug: 0.08 };
        let extended = Arm { flex: self.aim, abduct: 0.02, twist: -0.2, elbow: 0.12, shrug: 0.12 };
        for side in Side::BOTH {
            let reach = if side == striking { strike } else { 0.0 };
            posture.reach([side], guard.mix(extended, reach), on);
        }
        let (trunk, turn) = (&mut posture.trunk, striking.sign() * strike * on);
        trunk.spine_twist -= 0.5 * turn;
        trunk.pelvis_twist -= 0.2 * turn;
        trunk.head_turn += 0.6 * turn;
        trunk.shift_forward += 0.04 * strike * on;
        trunk.rise -= 0.04 * on;
    }

    /// The fist that strikes, and how far it is out.
    fn thrown(&self, t: f32) -> (Side, f32) {
        let cycle = (t / self.repeats.period).clamp(0.0, self.repeats.count as f32);
        let u = cycle.fract();
        let odd = self.alternates && cycle as u32 % 2 == 1;
        let side = if odd { self.first.other() } else { self.first };
        (side, smooth((u - 0.2) / 0.25) * smooth((0.85 - u) / 0.3))
    }
}

// Actions of the whole body.

/// Sitting down on a seat behind, and standing up again or not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sit {
    /// Metres by which the pelvis goes down.
    pub depth: f32,
    /// Seconds down, and of sitting.
    pub lowering: f32,
    pub hold: f32,
    pub rises: bool,
}

impl Sit {
    pub fn sample(m: &Manner, rng: &mut impl Draw) -> Self {
        Self {
            depth: rng.uniform(0.4, 0.48) - m.traits.crouch,
            lowering: rng.uniform(1.1, 1.6) / m.traits.energy,
            hold: rng.uniform(0.6, 3.0),
            rises: rng.chance(0.55),
        }
    }

    fn seated(&self, t: f32) -> f32 {
        let down = smooth(t / self.lowering);
        if self.rises { down * smooth((self.duration() - t) / self.lowering) } else { down }
    }

    pub fn duration(&self) -> f32 {
        self.hold + if self.rises { 2.0 } else { 1.0 } * self.lowering
    }

    pub fn posture(&self, posture: &mut Posture, t: f32) {
        let seated = self.seated(t);
        // The trunk goes forward while the weight is between feet and seat.
        let between = (PI * seated).sin();
        let trunk = &mut posture.trunk;
        trunk.rise -= self.depth * seated;
        trunk.shift_forward -= 0.4 * seated;
        trunk.pelvis_pitch += 0.45 * between - 0.12 * seated;
        trunk.spine_pitch += 0.45 * between + 0.06 * seated;
        trunk.head_pitch -= 0.25 * between;
        let lap = Arm { flex: 0.36, abduct: 0.1, twist: -0.3, elbow: 0.8, shrug: 0.0 };
        posture.reach(Side::BOTH, lap, seated);
        posture.arms.iter_mut().for_each(|arm| arm.flex += 0.5 * between);
    }
}

/// 0 at the ends of each repeat, 1 for a while in its middle.
pub fn cycle(repeats: &Repeats, t: f32) -> f32 {
    plateau(repeats.since_start(t), repeats.period, 0.42 * repeats.period)
}

pub fn clap(posture: &mut Posture, repeats: &Repeats, height: f32, t: f32, total: f32) {
    let on = plateau(t, total, 0.5);
    let beat = TAU * (t - 0.5) / repeats.period;
    let open = (0.5 + 0.5 * beat.cos()) * on;
    let low = Arm { flex: 0.75, abduct: -0.03, twist: -0.72, elbow: 1.25, shrug: 0.03 };
    let high = Arm { flex: 2.7, abduct: -0.1, twist: -1.35, elbow: 0.66, shrug: 0.25 };
    let mut target = low.mix(high, height);
    target.abduct += (0.22 + 0.1 * height) * open;
    target.twist += (0.45 - 0.3 * height) * open;
    posture.reach(Side::BOTH, target, on);
}

pub fn stretch(posture: &mut Posture, out: f32, up: f32) {
    let forward = Arm { flex: 2.85, abduct: 0.12, twist: 0.0, elbow: 0.15, shrug: 0.35 };
    let sideways = Arm { flex: 0.0, abduct: 2.75, twist: 0.6, elbow: 0.15, shrug: 0.35 };
    posture.reach(Side::BOTH, forward.mix(sideways, out.round()), up);
    posture.trunk.spine_pitch -= (0.1 + 0.12 * out) * up;
    posture.trunk.head_pitch -= 0.3 * up;
}

pub fn bow(posture: &mut Posture, depth: f32) {
    let trunk = &mut posture.trunk;
    trunk.pelvis_pitch += 0.55 * depth;
    trunk.spine_pitch += 0.75 * depth;
    trunk.head_pitch += 0.25 * depth;
    trunk.shift_forward -= 0.13 * depth;
    // Arms keep hanging by the legs.
    posture.arms.iter_mut().for_each(|arm| arm.flex += 0.75 * depth);
}

pub fn squat(posture: &mut Posture, depth: f32, down: f32) {
    let trunk = &mut posture.trunk;
    trunk.rise -= depth * down;
    trunk.shift_forward -= 0.3 * depth * down;
    trunk.pelvis_pitch += 0.8 * depth * down;
    trunk.spine_pitch += 0.9 * depth * down;
    trunk.head_pitch -= 0.8 * depth * down;
    let ahead = Arm { flex: 1.3, abduct: 0.1, twist: -0.2, elbow: 0.35, shrug: 0.05 };
    posture.reach(Side::BOTH, ahead, 0.85 * down);
}

pub fn look(posture: &mut Posture, first: Option<Side>, t: f32, total: f32) {
    let Some(first) = first else { return };
    let turn = first.sign() * (TAU * t / total).sin() * plateau(t, total, 0.2);
    posture.trunk.head_turn += 0.75 * turn;
    posture.trunk.spine_twist += 0.25 * turn;
}
