//! Jumps and kicks: actions that take the feet off the floor.

use std::f32::consts::{FRAC_PI_2, PI};

use super::feet::{ANKLE, Flight, Key};
use super::in_place::Repeats;
use super::manner::{Manner, Posture};
use super::maths::{Draw, Drive, FloorPose, Side, arch, plateau, smooth};

/// Metres per second squared.
const GRAVITY: f32 = 9.81;

/// Share of the wind-up after which the body is lowest.
const BOTTOM: f32 = 0.68;

/// The direction of a jump.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    Up,
    Forward,
    Back,
    Sideways(Side),
    /// Up, with a turn in the air.
    Spin(Side),
}

/// A number of equal jumps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    pub aim: Aim,
    pub count: u32,
    /// Rise of the body in flight, metres.
    pub height: f32,
    /// Metres of one jump over the floor.
    pub distance: f32,
    /// Radians to the left of one jump.
    pub turn: f32,
    /// Metres by which the body sinks before.
    pub crouch: f32,
    /// Seconds before the lift and after the landing.
    pub wind_up: f32,
    pub settle: f32,
    /// The upward swing of the arms.
    pub arms: f32,
}

impl Jump {
    /// Draws jumps that take no longer than `budget` seconds, if there are any.
    pub fn sample(m: &Manner, budget: f32, rng: &mut impl Draw) -> Option<Self> {
        let side = rng.one_of(&Side::BOTH);
        let aim = rng.weighted(&[
            (Aim::Up, 5.0),
            (Aim::Forward, 4.0),
            (Aim::Back, 1.0),
            (Aim::Sideways(side), 1.4),
            (Aim::Spin(side), 0.8),
        ]);
        let energy = m.traits.energy;
        let height = (rng.uniform(0.08, 0.38) * energy).clamp(0.05, 0.45);
        let mut jump = Self {
            aim,
            count: rng.weighted(&[(1, 5.0), (2, 3.0), (3, 2.0), (4, 1.0)]),
            height,
            distance: reach(aim, rng) * energy.sqrt(),
            turn: spin(aim, rng),
            crouch: (0.1 + 0.5 * height + rng.around(0.0, 0.02)).clamp(0.1, 0.32),
            wind_up: rng.uniform(0.4, 0.6) / energy.sqrt(),
            settle: rng.uniform(0.4, 0.6) / energy.sqrt(),
            arms: rng.uniform(0.3, 1.0) * (height / 0.25).clamp(0.3, 1.0),
        };
        jump.count = jump.count.min((budget / jump.period()) as u32);
        (jump.count > 0).then_some(jump)
    }

    /// Seconds in the air: the time a body takes to rise and fall by the height.
    pub fn flight(&self) -> f32 {
        (8.0 * self.height / GRAVITY).sqrt()
    }

    /// Seconds of one jump.
    pub fn period(&self) -> f32 {
        self.wind_up + self.flight() + self.settle
    }

    /// Seconds of all jumps.
    pub fn duration(&self) -> f32 {
        self.count as f32 * self.period()
    }

    /// Lift and landing of jump `i`, seconds after the start.
    pub fn airtime(&self, i: u32) -> (f32, f32) {
        let lift = i as f32 * self.period() + self.wind_up;
        (lift, lift + self.flight())
    }

    /// Velocity of the flight; zero on the floor.
    pub fn drive(&self, t: f32) -> Drive {
        let local = t.rem_euclid(self.period()) - self.wind_up;
        if !(0.0..self.duration()).contains(&t) || !(0.0..self.flight()).contains(&local) {
            return Drive::default();
        }
        let speed = self.distance / self.flight();
        let yaw = self.turn / self.flight();
        match self.aim {
            Aim::Up | Aim::Spin(_) => Drive { left: 0.0, forward: 0.0, yaw },
            Aim::Forward => Drive { left: 0.0, forward: speed, yaw },
            Aim::Back => Drive { left: 0.0, forward: -speed, yaw },
            Aim::Sideways(side) => Drive { left: side.sign() * speed, forward: 0.0, yaw },
        }
    }

    /// Takes the posture `t` seconds after the start.
    pub fn posture(&self, posture: &mut Posture, t: f32) {
        let t = t.clamp(0.0, self.duration() - 1e-4).rem_euclid(self.period());
        let air = (t - self.wind_up) / self.flight();
        let landed = t - self.wind_up - self.flight();
        let bend = self.sink(t) + self.absorb(landed);
        let lift = arch(air);
        // On tiptoe at the lift, flat again at the landing.
        let tiptoe = self.push(t) * (1.0 - smooth(air));
        let trunk = &mut posture.trunk;
        trunk.rise += self.height * lift - self.crouch * bend + 0.07 * tiptoe;
        trunk.shift_forward -= 0.07 * bend;
        trunk.pelvis_pitch += 1.2 * self.crouch * bend - 0.05 * lift;
        trunk.spine_pitch += 1.8 * self.crouch * bend - 0.12 * lift;
        trunk.head_pitch -= self.crouch * bend;
        self.throw_arms(posture, t, lift, bend);
    }

    /// Down slowly, up fast: 1 at the bottom, 0 at the lift with the legs still stretching.
    fn sink(&self, t: f32) -> f32 {
        let push = self.push(t);
        smooth(t / (BOTTOM * self.wind_up)) * (1.0 - push * push)
    }

    /// 0 until the body is lowest, 1 from the lift on.
    fn push(&self, t: f32) -> f32 {
        ((t / self.wind_up - BOTTOM) / (1.0 - BOTTOM)).clamp(0.0, 1.0)
    }

    /// Down fast, up slowly, after the landing.
    fn absorb(&self, landed: f32) -> f32 {
        let u = (landed / self.settle).clamp(0.0, 1.0);
        let fall = (u / 0.25).min(1.0);
        0.85 * fall * (2.0 - fall) * (1.0 - smooth((u - 0.25) / 0.75))
    }

    /// Back in the crouch, up in the flight, down after it.
    fn throw_arms(&self, posture: &mut Posture, t: f32, lift: f32, bend: f32) {
        let back = plateau(t, self.wind_up, 0.45 * self.wind_up);
        let up = lift.max(0.3 * bend * (1.0 - back));
        for arm in &mut posture.arms {
            arm.flex += self.arms * (1.9 * up - 0.9 * back);
            arm.abduct += 0.25 * self.arms * up;
            arm.elbow += 0.4 * self.arms * (up + back);
        }
    }
}

fn reach(aim: Aim, rng: &mut impl Draw) -> f32 {
    match aim {
        Aim::Forward => rng.uniform(0.25, 0.8),
        Aim::Back | Aim::Sideways(_) => rng.uniform(0.15, 0.4),
        Aim::Up | Aim::Spin(_) => 0.0,
    }
}

fn spin(aim: Aim, rng: &mut impl Draw) -> f32 {
    match aim {
        Aim::Spin(side) => side.sign() * rng.one_of(&[FRAC_PI_2, PI]) * rng.around(1.0, 0.06),
        _ => rng.around(0.0, 0.04),
    }
}

// Kicking: the body shifts over one leg while the other strikes.

/// Shares of a kick at which the foot lifts and lands.
const LIFT: f32 = 0.12;
const LAND: f32 = 0.88;

/// A number of equal kicks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kick {
    pub leg: Side,
    /// To the side rather than ahead.
    pub sideways: bool,
    /// Angle of the leg from straight down at the strike.
    pub angle: f32,
    pub repeats: Repeats,
    /// The backward swing of the leg, or the rise of the knee, before the strike.
    pub wind_up: f32,
}

impl Kick {
    /// Draws kicks that take no longer than `budget` seconds, if there are any.
    pub fn sample(m: &Manner, budget: f32, rng: &mut impl Draw) -> Option<Self> {
        let sideways = rng.chance(0.28);
        let period = rng.uniform(1.2, 1.65) / m.traits.energy.sqrt();
        let angle = if sideways { rng.uniform(0.6, 1.2) } else { rng.uniform(0.6, 1.75) };
        let count = rng.weighted(&[(1, 6.0), (2, 3.0), (3, 1.5), (4, 0.5)]);
        let count = count.min((budget / period) as u32);
        let wind_up = rng.uniform(0.4, 1.0);
        let leg = m.preferred(rng);
        let angle = angle * m.traits.energy.clamp(0.8, 1.1);
        let repeats = Repeats { count, period };
        (count > 0).then_some(Self { leg, sideways, angle, repeats, wind_up })
    }

    /// Lift and landing of kick `i`, seconds after the start.
    pub fn airtime(&self, i: u32) -> (f32, f32) {
        let period = self.repeats.period;
        let start = i as f32 * period;
        (start + LIFT * period, start + LAND * period)
    }

    /// The flight of the foot between two places beside `root`; `flat` is a resting foot's pitch.
    pub fn flight(&self, root: FloorPose, from: FloorPose, to: FloorPose, flat: f32) -> Flight {
        let side = self.leg.sign();
        let (out, ahead) = if self.sideways { (0.95, 0.3) } else { (0.06, 1.0) };
        let on_floor = |place: FloorPose| {
            let (left, forward) = place.seen_from(root);
            [left, ANKLE, forward]
        };
        let rest = on_floor(to);
        let along = |distance: f32, up: f32| {
            [rest[0] + side * out * distance, ANKLE + up, rest[2] + ahead * distance]
        };
        let (s, c) = self.angle.sin_cos();
        let (hip, leg) = (0.86, 0.79);
        let strike = [rest[0] + side * out * leg * s, hip - leg * c, ahead * leg * s];
        let key = |at, position, pitch| Key { at, position, pitch };
        let cock = if self.sideways { 0.1 } else { -0.3 * self.wind_up };
        let keys = [
            key(0.0, on_floor(from), flat),
            key(0.3, along(cock, 0.16 + 0.14 * self.wind_up), 1.15),
            key(0.52, strike, (1.25 - 0.75 * self.angle).max(0.0)),
            key(0.72, along(0.22, 0.3), 0.8),
            key(1.0, rest, flat),
        ];
        Flight::Kick { root, keys }
    }

    /// Takes the posture `t` seconds after the start.
    pub fn posture(&self, posture: &mut Posture, t: f32) {
        let u = self.repeats.since_start(t) / self.repeats.period;
        let side = self.leg.sign();
        let whole = plateau(t, self.repeats.total(), 0.28);
        let strike = smooth((u - 0.32) / 0.2) * smooth((0.8 - u) / 0.25) * self.angle;
        let trunk = &mut posture.trunk;
        trunk.shift_left -= side * 0.075 * whole;
        trunk.rise -= 0.015 * whole;
        let lean = if self.sideways { (0.04, 0.3) } else { (0.2, 0.03) };
        trunk.pelvis_pitch -= lean.0 * strike;
        trunk.spine_pitch -= 0.3 * lean.0 * strike;
        trunk.pelvis_roll += side * lean.1 * strike;
        trunk.spine_roll += side * 0.4 * lean.1 * strike;
        trunk.pelvis_twist -= side * 0.16 * strike;
        trunk.spine_twist += side * 0.3 * strike;
        trunk.head_pitch += 0.6 * lean.0 * strike;
        self.balance(posture, whole, strike);
    }

    /// Arms out, the opposite one forward.
    fn balance(&self, posture: &mut Posture, whole: f32, strike: f32) {
        for side in Side::BOTH {
            let forward = if side == self.leg { -0.35 } else { 0.4 };
            let arm = &mut posture.arms[side.index()];
            arm.abduct += 0.3 * whole + 0.15 * strike;
            arm.flex += forward * strike;
            arm.elbow += 0.5 * whole;
        }
    }
}
