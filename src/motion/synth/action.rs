//! The actions, and how one follows another.

use super::drive::Drive;
use super::floor::Side;
use super::in_place::{InPlace, Kind};
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
    InPlace(InPlace),
}

/// The kinds of actions, to draw from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Choice {
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
        last: Option<&Action>,
        m: &Manner,
        budget: f32,
        rng: &mut impl Draw,
    ) -> Option<Self> {
        let table = WEIGHTS.map(|(choice, weight)| (choice, weight * affinity(last, choice)));
        (0..4).find_map(|_| Self::of(rng.weighted(&table), m, budget, rng))
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
            Choice::Still(kind) => {
                return InPlace::sample(kind, m, budget, rng).map(Self::InPlace);
            }
        };
        Travel::sample(gait, m, budget, rng).map(Self::Travel)
    }

    fn choice(&self) -> Choice {
        match self {
            Self::Travel(travel) => match travel.gait {
                Gait::Walk => Choice::Walk,
                Gait::Run => Choice::Run,
                Gait::Back => Choice::Back,
                Gait::Sideways(_) => Choice::Sideways,
                Gait::Turn(_) => Choice::Turn,
                Gait::Arc(_) => Choice::Arc,
            },
            Self::Jump(_) => Choice::Jump,
            Self::Kick(_) => Choice::Kick,
            Self::InPlace(action) => Choice::Still(action.kind()),
        }
    }

    /// Seconds of the action.
    pub fn duration(&self) -> f32 {
        match self {
            Self::Travel(travel) => travel.duration(),
            Self::Jump(jump) => jump.duration(),
            Self::Kick(kick) => kick.duration(),
            Self::InPlace(action) => action.duration(),
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
        matches!(self, Self::InPlace(InPlace::Sit(sit)) if !sit.rises)
    }

    /// The root's velocity `t` seconds after the start.
    pub fn drive(&self, t: f32) -> Drive {
        match self {
            Self::Travel(travel) => travel.drive(),
            Self::Jump(jump) => jump.drive(t),
            Self::Kick(_) | Self::InPlace(_) => Drive::default(),
        }
    }

    /// The posture `t` seconds after the start.
    pub fn posture(&self, t: f32, m: &Manner) -> Posture {
        match self {
            Self::Travel(travel) => travel.posture(t, m),
            Self::Jump(jump) => jump.posture(t, m),
            Self::Kick(kick) => kick.posture(t, m),
            Self::InPlace(action) => action.posture(t, m),
        }
    }
}

/// How much likelier `next` is after `last` than at the start of a clip.
fn affinity(last: Option<&Action>, next: Choice) -> f32 {
    use Choice::{Arc, Back, Jump, Kick, Run, Still, Turn, Walk};
    let Some(last) = last.map(Action::choice) else { return 1.0 };
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
