//! What actions are called.

/// A verb as in "she walks" and as in "before walking".
#[derive(Clone, Copy, Debug)]
pub struct Verb {
    pub finite: &'static str,
    pub gerund: &'static str,
}

/// A verb of these forms.
pub const fn verb(finite: &'static str, gerund: &'static str) -> Verb {
    Verb { finite, gerund }
}

pub const WALK: [Verb; 4] = [
    verb("walks", "walking"),
    verb("walks", "walking"),
    verb("strolls", "strolling"),
    verb("paces", "pacing"),
];
pub const RUN: [Verb; 3] =
    [verb("runs", "running"), verb("runs", "running"), verb("jogs", "jogging")];
pub const SPRINT: [Verb; 2] = [verb("runs", "running"), verb("sprints", "sprinting")];
pub const BACK: [Verb; 3] = [
    verb("walks backward", "walking backward"),
    verb("walks backwards", "walking backwards"),
    verb("backs up", "backing up"),
];
pub const SIDEWAYS: [Verb; 3] = [
    verb("sidesteps", "sidestepping"),
    verb("steps sideways", "stepping sideways"),
    verb("shuffles sideways", "shuffling sideways"),
];
pub const TURN: [Verb; 3] =
    [verb("turns", "turning"), verb("turns", "turning"), verb("rotates", "rotating")];
pub const JUMP: [Verb; 3] =
    [verb("jumps", "jumping"), verb("jumps", "jumping"), verb("leaps", "leaping")];
pub const HOP: [Verb; 2] = [verb("jumps", "jumping"), verb("hops", "hopping")];
pub const STAND: [Verb; 3] = [
    verb("stands still", "standing still"),
    verb("waits", "waiting"),
    verb("stands in place", "standing in place"),
];
pub const LOOK: [Verb; 2] =
    [verb("looks around", "looking around"), verb("looks about", "looking about")];
pub const STRETCH: [Verb; 3] = [
    verb("raises both arms", "raising both arms"),
    verb("lifts the arms", "lifting the arms"),
    verb("stretches the arms", "stretching the arms"),
];
pub const SQUAT: [Verb; 2] = [verb("squats", "squatting"), verb("crouches down", "crouching down")];
pub const SIT: [Verb; 2] =
    [verb("sits down", "sitting down"), verb("takes a seat", "taking a seat")];
pub const PUNCH: [Verb; 2] =
    [verb("punches", "punching"), verb("throws punches", "throwing punches")];
