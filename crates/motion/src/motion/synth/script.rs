//! [`Script`]: everything about a clip but its noise.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

use super::FPS;
use super::act::{Act, FOREVER};
use super::action::Action;
use super::drive::Drive;
use super::manner::Manner;
use super::posture::Posture;
use super::random::Draw;

/// Frames of the shortest and the longest clip.
const SHORTEST: usize = 40;
const LONGEST: usize = 196;

/// Frames of one token of every tokenizer: clips are whole numbers of tokens.
const UNIT: usize = 4;

/// Who moves, what they do and when: a clip before it is performed.
///
/// Sampling takes microseconds; length and captions follow without performing.
#[derive(Clone, Debug, PartialEq)]
pub struct Script {
    pub(super) manner: Manner,
    pub(super) acts: Vec<Act>,
    n_frames: usize,
    /// Seeds of the performance's noise and of the captions' wording.
    pub(super) noise: u64,
    pub(super) wording: u64,
}

impl Script {
    /// Draws a mover, one to four actions that fit a clip, and their times.
    pub fn sample(rng: &mut ChaCha8Rng) -> Self {
        let manner = Manner::sample(rng);
        let mut acts = Vec::with_capacity(4);
        let wanted = rng.weighted(&[(1, 0.2), (2, 0.36), (3, 0.28), (4, 0.16)]);
        let mut now = if rng.chance(0.5) { 0.0 } else { rng.uniform(0.0, 0.9) };
        while acts.len() < wanted {
            let Some(act) = next_act(&mut acts, now, &manner, rng) else {
                // A clip without any action is none: draw again.
                if acts.is_empty() {
                    continue;
                }
                break;
            };
            now = act.end() + pause(&act, rng);
            acts.push(act);
            if act.action.is_final() {
                break;
            }
        }
        begin_under_way(&mut acts, rng);
        let n_frames = whole_units(finish(&mut acts, rng));
        Self { manner, acts, n_frames, noise: rng.next_u64(), wording: rng.next_u64() }
    }

    /// Frames of the clip's features: a multiple of 4 from 40 to 196.
    pub fn n_frames(&self) -> usize {
        self.n_frames
    }

    /// Seconds of the clip.
    pub(super) fn seconds(&self) -> f32 {
        self.n_frames as f32 / FPS
    }

    /// The time at which the first act began, at most 0.
    pub(super) fn begins(&self) -> f32 {
        self.acts.first().map_or(0.0, |act| (act.start - act.early).min(0.0))
    }

    /// The root's velocity at `t`.
    pub(super) fn drive(&self, t: f32) -> Drive {
        self.acts.iter().find_map(|act| act.drive(t)).unwrap_or_default()
    }

    /// The posture at `t`, without noise.
    pub(super) fn posture(&self, t: f32) -> Posture {
        let idle = Posture::idle(&self.manner);
        self.acts.iter().fold(idle, |posture, act| act.over(posture, t, &self.manner))
    }
}

/// Draws the act at `now`: at times the last act but one once more, else a new action. Steps
/// after steps join them at once.
fn next_act(acts: &mut [Act], now: f32, m: &Manner, rng: &mut ChaCha8Rng) -> Option<Act> {
    let budget = |start: f32| LONGEST as f32 / FPS - 0.1 - start;
    let repeated = acts.len().checked_sub(2).map(|i| (acts[i].choice, acts[i].action));
    let repeated = repeated.filter(|(_, a)| rng.chance(0.3) && a.duration() <= budget(now));
    let last = acts.last_mut();
    let drawn = match repeated {
        Some(drawn) => drawn,
        None => Action::sample(last.as_ref().map(|act| act.choice), m, budget(now), rng)?,
    };
    let mut act = Act { again: repeated.is_some(), ..Act::new(drawn, now) };
    if let Some(last) = last {
        join_steps(last, &mut act);
    }
    Some(act)
}

/// Steps that follow steps begin at once, with the other foot.
fn join_steps(last: &mut Act, act: &mut Act) {
    if let (Some(before), Action::Travel(after)) = (last.action.travel(), &mut act.action) {
        after.first = before.foot(before.steps as i32);
        act.gathers = !before.carries_into(after);
        let slows = !after.carries_into(before);
        act.start = last.end();
        (last.joins_next, last.slows) = (true, slows);
    }
}

/// Seconds between the end of an act and the next: after steps, at least a closing step.
fn pause(act: &Act, rng: &mut ChaCha8Rng) -> f32 {
    let u = rng.unit();
    let closing = act.action.travel().map_or(0.0, |travel| 1.35 * travel.step_time);
    closing + 0.7 * u * u
}

/// A clip that opens with steps is often cut from a longer walk.
fn begin_under_way(acts: &mut [Act], rng: &mut ChaCha8Rng) {
    let Some(first) = acts.first_mut() else { return };
    if let Some(travel) = first.action.travel().filter(|t| t.speed() > 0.25)
        && first.start == 0.0
        && rng.chance(0.8)
    {
        first.early = 3.0 * travel.step_time;
        first.gathers = false;
    }
}

/// Seconds of the clip; one that ends with steps is often cut before they stop.
fn finish(acts: &mut [Act], rng: &mut ChaCha8Rng) -> f32 {
    let Some(last) = acts.last_mut() else { return 0.0 };
    let end = last.end();
    let cut = last.action.travel().is_some_and(|t| t.speed() > 0.25) && rng.chance(0.5);
    if cut && end > SHORTEST as f32 / FPS {
        last.late = FOREVER;
        last.slows = false;
        return end;
    }
    end + pause(last, rng) + rng.uniform(0.0, 0.8)
}

fn whole_units(seconds: f32) -> usize {
    ((seconds * FPS) as usize).next_multiple_of(UNIT).clamp(SHORTEST, LONGEST)
}
