//! Kicking: the body shifts over one leg while the other strikes.

use super::blend::{plateau, smooth};
use super::feet::{ANKLE, Flight, Key};
use super::floor::{FloorPose, Side};
use super::hands::Repeats;
use super::manner::Manner;
use super::posture::Posture;
use super::random::Draw;

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
    /// How far the leg swings back, or the knee up, before the strike.
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
            let arm = posture.arm(side);
            arm.abduct += 0.3 * whole + 0.15 * strike;
            arm.flex += forward * strike;
            arm.elbow += 0.5 * whole;
        }
    }
}
