//! What actions are called.

/// A verb as in "she walks" and as in "before walking".
pub type Verb = (&'static str, &'static str);

pub const WALK: [Verb; 4] =
    [("walks", "walking"), ("walks", "walking"), ("strolls", "strolling"), ("paces", "pacing")];
pub const RUN: [Verb; 3] = [("runs", "running"), ("runs", "running"), ("jogs", "jogging")];
pub const SPRINT: [Verb; 2] = [("runs", "running"), ("sprints", "sprinting")];
pub const BACK: [Verb; 3] = [
    ("walks backward", "walking backward"),
    ("walks backwards", "walking backwards"),
    ("backs up", "backing up"),
];
pub const SIDEWAYS: [Verb; 3] = [
    ("sidesteps", "sidestepping"),
    ("steps sideways", "stepping sideways"),
    ("shuffles sideways", "shuffling sideways"),
];
pub const TURN: [Verb; 3] = [("turns", "turning"), ("turns", "turning"), ("rotates", "rotating")];
pub const JUMP: [Verb; 3] = [("jumps", "jumping"), ("jumps", "jumping"), ("leaps", "leaping")];
pub const HOP: [Verb; 2] = [("jumps", "jumping"), ("hops", "hopping")];
pub const STAND: [Verb; 3] = [
    ("stands still", "standing still"),
    ("waits", "waiting"),
    ("stands in place", "standing in place"),
];
pub const LOOK: [Verb; 2] = [("looks around", "looking around"), ("looks about", "looking about")];
pub const STRETCH: [Verb; 3] = [
    ("raises both arms", "raising both arms"),
    ("lifts the arms", "lifting the arms"),
    ("stretches the arms", "stretching the arms"),
];
pub const SQUAT: [Verb; 2] = [("squats", "squatting"), ("crouches down", "crouching down")];
pub const SIT: [Verb; 2] = [("sits down", "sitting down"), ("takes a seat", "taking a seat")];
pub const PUNCH: [Verb; 2] = [("punches", "punching"), ("throws punches", "throwing punches")];
