//! The actions, and how one follows another.

use super::blend::{plateau, smooth};
use super::drive::Drive;
use super::floor::Side;
use super::hands::{Punch, Repeats, Wave};
use super::jump::Jump;
use super::kick::Kick;
use super::manner::Manner;
use super::posture::{Arm, Posture};
use super::random::Draw;
use super::travel::{Gait, Travel};
use std::f32::consts::{PI, TAU};

/// One thing that a body does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    Travel(Travel),
    Jump(Jump),
    Kick(Kick),
    Wave(Wave),
    Punch(Punch),
    /// Clapping, and its height: 0 before the chest, 1 above the head.
    Clap(Repeats, f32),
    /// Raising both arms; `out` 0 forward and up, 1 by the sides and up.
    Stretch {
        hold: f32,
        out: f32,
        raise: f32,
    },
    /// Bowing, and its depth, 1 the deepest.
    Bow(Repeats, f32),
    /// Squatting, and by how many metres.
    Squat(Repeats, f32),
    Sit(Sit),
    /// Standing for some seconds, with a look to a side first and to the other then, or without.
    Stand(f32, Option<Side>),
}

/// The kinds of actions, to draw from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    Walk,
    Run,
    Back,
    Sideways,
    Turn,
    Arc,
    Jump,
    Kick,
    Still(Kind),
}

/// Roughly Zipf's law: the first kinds make most of the clips, the last ones are rare.
const WEIGHTS: [(Choice, f32); 16] = [
    (Choice::Walk, 27.0),
    (Choice::Turn, 13.0),
    (Choice::Run, 9.0),
    (Choice::Still(Kind::Wave), 8.0),
    (Choice::Jump, 7.0),
    (Choice::Kick, 6.0),
    (Choice::Still(Kind::Sit), 5.0),
    (Choice::Arc, 4.5),
    (Choice::Back, 4.0),
    (Choice::Sideways, 3.5),
    (Choice::Still(Kind::Stand), 3.0),
    (Choice::Still(Kind::Punch), 2.4),
    (Choice::Still(Kind::Clap), 2.0),
    (Choice::Still(Kind::Stretch), 1.6),
    (Choice::Still(Kind::Squat), 1.2),
    (Choice::Still(Kind::Bow), 1.0),
];

impl Action {
    /// Draws an action that fits `budget` seconds, by preference one that often follows `last`.
    pub fn sample(
        last: Option<Choice>,
        m: &Manner,
        budget: f32,
        rng: &mut impl Draw,
    ) -> Option<(Choice, Self)> {
        let table = WEIGHTS.map(|(choice, weight)| (choice, weight * affinity(last, choice)));
        (0..4).find_map(|_| {
            let choice = rng.weighted(&table);
            Some((choice, Self::of(choice, m, budget, rng)?))
        })
    }

    fn of(choice: Choice, m: &Manner, budget: f32, rng: &mut impl Draw) -> Option<Self> {
        let side = rng.one_of(&Side::BOTH);
        let gait = match choice {
            Choice::Walk => Gait::Walk,
            Choice::Run => Gait::Run,
            Choice::Back => Gait::Back,
            Choice::Sideways => Gait::Sideways(side),
            Choice::Turn => Gait::Turn(side),
            Choice::Arc => Gait::Arc(side),
            Choice::Jump => return Jump::sample(m, budget, rng).map(Self::Jump),
            Choice::Kick => return Kick::sample(m, budget, rng).map(Self::Kick),
            Choice::Still(kind) => return Self::in_place(kind, m, budget, rng),
        };
        Travel::sample(gait, m, budget, rng).map(Self::Travel)
    }

    /// Seconds of the action.
    pub fn duration(&self) -> f32 {
        match self {
            Self::Travel(travel) => travel.duration(),
            Self::Jump(jump) => jump.duration(),
            Self::Kick(kick) => kick.repeats.total(),
            Self::Wave(wave) => wave.duration(),
            Self::Punch(punch) => punch.duration(),
            Self::Clap(repeats, _) => 1.0 + repeats.total(),
            Self::Stretch { hold, raise, .. } => hold + 2.0 * raise,
            Self::Bow(repeats, _) | Self::Squat(repeats, _) => repeats.total(),
            Self::Sit(sit) => sit.duration(),
            Self::Stand(hold, _) => *hold,
        }
    }

    /// The steps, if it is made of steps.
    pub fn travel(&self) -> Option<&Travel> {
        match self {
            Self::Travel(travel) => Some(travel),
            _ => None,
        }
    }

    /// Whether the body stays where the action leaves it: nothing can follow.
    pub fn is_final(&self) -> bool {
        matches!(self, Self::Sit(sit) if !sit.rises)
    }

    /// The root's velocity `t` seconds after the start.
    pub fn drive(&self, t: f32) -> Drive {
        match self {
            Self::Travel(travel) => travel.drive(),
            Self::Jump(jump) => jump.drive(t),
            _ => Drive::default(),
        }
    }

    /// The posture `t` seconds after the start.
    pub fn posture(&self, t: f32, m: &Manner) -> Posture {
        let mut posture = Posture::idle(m);
        let total = self.duration();
        match self {
            Self::Travel(travel) => travel.posture(&mut posture, t, m),
            Self::Jump(jump) => jump.posture(&mut posture, t),
            Self::Kick(kick) => kick.posture(&mut posture, t),
            Self::Wave(wave) => wave.raise_arms(&mut posture, t),
            Self::Punch(punch) => punch.strike(&mut posture, t),
            Self::Clap(repeats, height) => clap(&mut posture, repeats, *height, t, total),
            Self::Stretch { out, raise, .. } => {
                stretch(&mut posture, *out, plateau(t, total, *raise));
            }
            Self::Bow(repeats, depth) => bow(&mut posture, depth * cycle(repeats, t)),
            Self::Squat(repeats, depth) => squat(&mut posture, *depth, cycle(repeats, t)),
            Self::Sit(sit) => sit.posture(&mut posture, t),
            Self::Stand(_, looks) => look(&mut posture, *looks, t, total),
        }
        posture
    }
}

/// How much likelier `next` is after `last` than at the start of a clip.
fn affinity(last: Option<Choice>, next: Choice) -> f32 {
    use Choice::{Arc, Back, Jump, Kick, Run, Still, Turn, Walk};
    let Some(last) = last else { return 1.0 };
    match (last, next) {
        (last, next) if last == next => 0.1,
        (Walk | Arc, Turn) => 2.2,
        (Turn, Walk | Run) => 2.5,
        (Walk, Run) | (Run, Jump) | (Back, Walk) => 2.0,
        (Run, Walk) => 1.5,
        (Kick, Still(Kind::Punch)) | (Still(Kind::Punch), Kick) => 6.0,
        (Jump, Still(Kind::Clap)) | (Still(Kind::Wave), Still(Kind::Bow)) => 4.0,
        (Walk | Turn, Still(Kind::Sit | Kind::Wave)) => 1.5,
        _ => 1.0,
    }
}

// Actions on planted feet: those of the hands, stretching, bowing, squatting, sitting, standing.

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
    fn sample(m: &Manner, rng: &mut impl Draw) -> Self {
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

/// The kinds of actions that leave the feet where they are, to draw from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Wave,
    Punch,
    Clap,
    Stretch,
    Bow,
    Squat,
    Sit,
    Stand,
}

impl Action {
    /// Draws an action of a kind that takes no longer than `budget` seconds, if there is one.
    pub fn in_place(kind: Kind, m: &Manner, budget: f32, rng: &mut impl Draw) -> Option<Self> {
        let energy = m.traits.energy;
        let action = match kind {
            Kind::Wave => Self::Wave(Wave::sample(m, budget, rng)?),
            Kind::Punch => Self::Punch(Punch::sample(m, budget, rng)?),
            Kind::Clap => Self::sample_clap(energy, budget, rng)?,
            Kind::Stretch => Self::Stretch {
                hold: rng.uniform(0.3, 1.6),
                out: rng.unit(),
                raise: rng.uniform(0.7, 1.1) / energy,
            },
            Kind::Bow => Self::Bow(
                Repeats::sample((1, 2), rng.uniform(1.6, 2.5) / energy, budget, rng)?,
                rng.uniform(0.35, 1.0),
            ),
            Kind::Squat => Self::Squat(
                Repeats::sample((1, 4), rng.uniform(1.4, 2.1) / energy, budget, rng)?,
                rng.uniform(0.2, 0.5),
            ),
            Kind::Sit => Self::Sit(Sit::sample(m, rng)),
            Kind::Stand => {
                Self::Stand(rng.uniform(1.0, 3.0), rng.chance(0.5).then(|| rng.one_of(&Side::BOTH)))
            }
        };
        (action.duration() <= budget).then_some(action)
    }

    fn sample_clap(energy: f32, budget: f32, rng: &mut impl Draw) -> Option<Self> {
        let period = rng.uniform(0.36, 0.6) / energy;
        let repeats = Repeats::sample((2, 8), period, budget - 1.0, rng)?;
        let overhead = rng.chance(0.25);
        let height = if overhead { rng.uniform(0.8, 1.0) } else { rng.uniform(0.0, 0.2) };
        Some(Self::Clap(repeats, height))
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
