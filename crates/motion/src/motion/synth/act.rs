//! An action in its place on the time line of a clip.

use super::action::{Action, Choice};
use super::blend::smooth;
use super::drive::Drive;
use super::manner::Manner;
use super::posture::Posture;
use super::travel::Travel;

/// Half of the seconds in which one posture gives way to the next.
const FADE: f32 = 0.28;

/// Longer than any clip: for what does not end within it.
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
    /// The next act begins where this one ends.
    pub joins_next: bool,
    /// Steps gather speed at the start, or lose it at the end.
    pub gathers: bool,
    pub slows: bool,
    /// The same action, with the same numbers, stands earlier in the clip.
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

    /// `before`, given way to this act's posture as far as `t` asks for it.
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
