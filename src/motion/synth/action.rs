//! The actions, and how one follows another.

use super::blend::plateau;
use super::drive::Drive;
use super::floor::Side;
use super::hands::{Punch, Repeats, Wave};
use super::in_place::{Kind, Sit, bow, clap, cycle, look, squat, stretch};
use super::jump::Jump;
use super::kick::Kick;
use super::manner::Manner;
use super::posture::Posture;
use super::random::Draw;
use super::travel::{Gait, Travel};

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
