//! The actions, how one follows another, and their places on the time line of a clip.

use super::airborne::{Jump, Kick};
use super::in_place::{Punch, Repeats, Sit, Wave, bow, clap, cycle, look, squat, stretch};
use super::manner::{Manner, Posture};
use super::maths::{Blend, Draw, Drive, Side, plateau, smooth};
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
    Wave,
    Punch,
    Clap,
    Stretch,
    Bow,
    Squat,
    Sit,
    Stand,
}

/// Roughly Zipf's law: the first kinds make most of the clips, the last ones are rare.
const WEIGHTS: [(Choice, f32); 16] = [
    (Choice::Walk, 27.0),
    (Choice::Turn, 13.0),
    (Choice::Run, 9.0),
    (Choice::Wave, 8.0),
    (Choice::Jump, 7.0),
    (Choice::Kick, 6.0),
    (Choice::Sit, 5.0),
    (Choice::Arc, 4.5),
    (Choice::Back, 4.0),
    (Choice::Sideways, 3.5),
    (Choice::Stand, 3.0),
    (Choice::Punch, 2.4),
    (Choice::Clap, 2.0),
    (Choice::Stretch, 1.6),
    (Choice::Squat, 1.2),
    (Choice::Bow, 1.0),
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

    fn of<R: Draw>(choice: Choice, m: &Manner, budget: f32, rng: &mut R) -> Option<Self> {
        let side = rng.one_of(&Side::BOTH);
        let steps = |gait, rng: &mut R| Travel::sample(gait, m, budget, rng).map(Self::Travel);
        let energy = m.traits.energy;
        let action = match choice {
            Choice::Walk => return steps(Gait::Walk, rng),
            Choice::Run => return steps(Gait::Run, rng),
            Choice::Back => return steps(Gait::Back, rng),
            Choice::Sideways => return steps(Gait::Sideways(side), rng),
            Choice::Turn => return steps(Gait::Turn(side), rng),
            Choice::Arc => return steps(Gait::Arc(side), rng),
            Choice::Jump => return Jump::sample(m, budget, rng).map(Self::Jump),
            Choice::Kick => return Kick::sample(m, budget, rng).map(Self::Kick),
            Choice::Wave => Self::Wave(Wave::sample(m, budget, rng)?),
            Choice::Punch => Self::Punch(Punch::sample(m, budget, rng)?),
            Choice::Clap => Self::sample_clap(energy, budget, rng)?,
            Choice::Stretch => Self::Stretch {
                hold: rng.uniform(0.3, 1.6),
                out: rng.unit(),
                raise: rng.uniform(0.7, 1.1) / energy,
            },
            Choice::Bow => Self::Bow(
                Repeats::sample((1, 2), rng.uniform(1.6, 2.5) / energy, budget, rng)?,
                rng.uniform(0.35, 1.0),
            ),
            Choice::Squat => Self::Squat(
                Repeats::sample((1, 4), rng.uniform(1.4, 2.1) / energy, budget, rng)?,
                rng.uniform(0.2, 0.5),
            ),
            Choice::Sit => Self::Sit(Sit::sample(m, rng)),
            Choice::Stand => {
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

    /// Whether no other action can follow.
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

/// Relative probability of `next` after `last`, compared with the start of a clip.
fn affinity(last: Option<Choice>, next: Choice) -> f32 {
    use Choice::{Arc, Back, Bow, Clap, Jump, Kick, Punch, Run, Sit, Turn, Walk, Wave};
    let Some(last) = last else { return 1.0 };
    match (last, next) {
        (last, next) if last == next => 0.1,
        (Walk | Arc, Turn) => 2.2,
        (Turn, Walk | Run) => 2.5,
        (Walk, Run) | (Run, Jump) | (Back, Walk) => 2.0,
        (Run, Walk) => 1.5,
        (Kick, Punch) | (Punch, Kick) => 6.0,
        (Jump, Clap) | (Wave, Bow) => 4.0,
        (Walk | Turn, Sit | Wave) => 1.5,
        _ => 1.0,
    }
}

// An action in its place on the time line of a clip.

/// Half of the seconds in which one posture gives way to the next.
const FADE: f32 = 0.28;

/// Longer than any clip: for actions without an end in it.
pub const FOREVER: f32 = 12.0;

/// An action with its time. A walk may have begun before the clip and go on after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Act {
    /// The kind of the action.
    pub choice: Choice,
    pub action: Action,
    /// Seconds from the clip's first frame.
    pub start: f32,
    /// Seconds during which the action was already going on before `start`.
    pub early: f32,
    /// Seconds for which it goes on after its own duration.
    pub late: f32,
    /// The state at the end, where the next act begins.
    pub joins_next: bool,
    /// Steps gather speed at the start, or lose it at the end.
    pub gathers: bool,
    pub slows: bool,
    /// The same action, with the same numbers, occurs earlier in the clip.
    pub again: bool,
}

impl Act {
    /// An act that begins and ends with its action.
    pub fn new((choice, action): (Choice, Action), start: f32) -> Self {
        let late = if action.is_final() { FOREVER } else { 0.0 };
        let (gathers, slows, joins_next, again) = (true, true, false, false);
        Self { choice, action, start, early: 0.0, late, joins_next, gathers, slows, again }
    }

    /// Seconds from the clip's first frame to the end of the action's own duration.
    pub fn end(&self) -> f32 {
        self.start + self.action.duration()
    }

    /// The root's velocity, if it is this act that drives it at `t`.
    pub fn drive(&self, t: f32) -> Option<Drive> {
        let active = (self.start - self.early..self.end() + self.late).contains(&t);
        active.then(|| {
            let drive = self.action.drive(t - self.start);
            let share = self.action.travel().map_or(1.0, |travel| self.speed_share(travel, t));
            Drive { left: share * drive.left, forward: share * drive.forward, ..drive }
        })
    }

    /// Share of the full speed: no leg can follow a body that runs at once.
    fn speed_share(&self, travel: &Travel, t: f32) -> f32 {
        let gather = |since: f32| 0.25 + 0.75 * smooth(since / travel.run_up());
        let start = if self.gathers { gather(t - self.start) } else { 1.0 };
        let end = if self.slows { gather(self.end() - t) } else { 1.0 };
        start.min(end)
    }

    /// Blends from `before` to this act's posture by `t`.
    pub fn over(&self, before: Posture, t: f32, m: &Manner) -> Posture {
        let weight = self.weight(t);
        if weight <= 0.0 {
            return before;
        }
        before.mix(self.action.posture(t - self.start, m), weight)
    }

    fn weight(&self, t: f32) -> f32 {
        let fade_in = smooth((t - self.start + self.early + FADE) / (2.0 * FADE));
        let left = self.end() + self.late - t;
        if !self.joins_next {
            return fade_in * smooth((left + FADE) / (2.0 * FADE));
        }
        // The next act has taken over in full when this one stops.
        if left > -FADE { fade_in } else { 0.0 }
    }
}
