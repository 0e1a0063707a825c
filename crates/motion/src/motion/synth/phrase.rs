//! Phrases for one action: a verb with more or fewer details.

use super::action::{Act, Action};
use super::airborne::{Aim, Jump, Kick};
use super::in_place::{Hands, Punch, Sit, Wave};
use super::maths::{Draw, Side};
use super::travel::{Gait, Travel};

/// A verb and its details.
#[derive(Clone, Debug)]
pub struct Phrase {
    pub verb: Verb,
    pub rest: Vec<String>,
}

const NUMBERS: [&str; 17] = [
    "no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven",
    "twelve", "thirteen", "fourteen", "fifteen", "sixteen",
];

impl Phrase {
    /// Words an act.
    pub fn of(act: &Act, rng: &mut impl Draw) -> Self {
        let mut phrase = match &act.action {
            Action::Travel(travel) => of_travel(travel, rng),
            Action::Jump(jump) => of_jump(jump, rng),
            Action::Kick(kick) => of_kick(kick, rng),
            Action::Wave(wave) => of_wave(wave, rng),
            Action::Punch(punch) => of_punch(punch, rng),
            Action::Clap(repeats, height) => {
                let place = if *height > 0.5 { "above the head" } else { "" };
                of_repeats(&[("claps", "clapping")], place, repeats.count, rng)
            }
            Action::Stretch { out, .. } => of_stretch(*out, rng),
            Action::Bow(repeats, depth) => {
                let depth = if *depth > 0.7 { "deeply" } else { "slightly" };
                let told = if rng.chance(0.6) { depth } else { "" };
                of_repeats(&[("bows", "bowing")], told, repeats.count, rng)
            }
            Action::Squat(repeats, depth) => {
                let told = if *depth > 0.38 && rng.chance(0.6) { "low" } else { "" };
                of_repeats(&SQUAT, told, repeats.count, rng)
            }
            Action::Sit(sit) => of_sit(sit, rng),
            Action::Stand(hold, looks) => {
                let told = if *hold > 2.0 && rng.chance(0.5) { "for a while" } else { "" };
                of_repeats(if looks.is_some() { &LOOK } else { &STAND }, told, 0, rng)
            }
        };
        if act.again {
            phrase.rest.push("again".to_owned());
        }
        phrase
    }

    fn new(verbs: &[Verb], rng: &mut impl Draw) -> Self {
        Self { verb: rng.one_of(verbs), rest: Vec::new() }
    }

    fn say(&mut self, words: impl Into<String>) {
        self.rest.push(words.into());
    }

    /// Says one of some words with a probability.
    fn say_at_times(&mut self, probability: f32, words: &[&str], rng: &mut impl Draw) {
        if rng.chance(probability) {
            self.say(rng.one_of(words));
        }
    }

    /// Says that a value is low or high: beyond this threshold, with this probability, this word.
    fn say_extreme(
        &mut self,
        value: f32,
        low: (f32, f32, &str),
        high: (f32, f32, &str),
        rng: &mut impl Draw,
    ) {
        if value > high.0 && rng.chance(high.1) {
            self.say(high.2);
        } else if value < low.0 && rng.chance(low.1) {
            self.say(low.2);
        }
    }

    fn say_times(&mut self, count: u32, rng: &mut impl Draw) {
        match count {
            1 if rng.chance(0.15) => self.say("once"),
            2 if rng.chance(0.5) => self.say("twice"),
            2.. if rng.chance(0.75) => self.say(format!("{} times", number(count))),
            2.. => self.say(if count > 3 { "many times" } else { "a few times" }),
            _ => {}
        }
    }
}

fn number(count: u32) -> &'static str {
    NUMBERS.get(count as usize).copied().unwrap_or("many")
}

fn of_travel(travel: &Travel, rng: &mut impl Draw) -> Phrase {
    let verbs: &[Verb] = match travel.gait {
        Gait::Walk | Gait::Arc(_) => &WALK,
        Gait::Run if travel.pace > 1.15 => &SPRINT,
        Gait::Run => &RUN,
        Gait::Back => &BACK,
        Gait::Sideways(_) => &SIDEWAYS,
        Gait::Turn(_) => &TURN,
    };
    let mut phrase = Phrase::new(verbs, rng);
    say_pace(&mut phrase, travel.pace, rng);
    match travel.gait {
        Gait::Walk | Gait::Run => say_ahead(&mut phrase, travel.turn, rng),
        Gait::Back => {}
        Gait::Sideways(side) => phrase.say(format!("to the {}", side.word())),
        Gait::Turn(side) => say_turn(&mut phrase, side, travel.turn.abs().to_degrees(), rng),
        Gait::Arc(side) => say_arc(&mut phrase, side, travel.turn.abs().to_degrees(), rng),
    }
    if !matches!(travel.gait, Gait::Turn(_)) && rng.chance(0.6) {
        let link = if rng.chance(0.5) { "for " } else { "" };
        phrase.say(format!("{link}{} steps", number(travel.steps)));
    }
    if let Some(wave) = &travel.wave {
        phrase.say(format!("while waving {}", hands(wave.hands, rng)));
    }
    phrase
}

fn say_pace(phrase: &mut Phrase, pace: f32, rng: &mut impl Draw) {
    if pace > 1.15 {
        phrase.say_at_times(0.75, &["quickly", "briskly", "at a fast pace", "fast"], rng);
    } else if pace < 0.86 {
        phrase.say_at_times(0.75, &["slowly", "at a slow pace", "leisurely"], rng);
    }
}

fn say_ahead(phrase: &mut Phrase, turn: f32, rng: &mut impl Draw) {
    if turn.abs() > 0.15 && rng.chance(0.6) {
        let side = if turn > 0.0 { Side::Left } else { Side::Right };
        phrase.say(format!("forward slightly to the {}", side.word()));
    } else {
        let words = ["forward", "forward", "straight ahead", "straight forward"];
        phrase.say_at_times(0.75, &words, rng);
    }
}

fn say_turn(phrase: &mut Phrase, side: Side, degrees: f32, rng: &mut impl Draw) {
    let side = side.word();
    phrase.say(if rng.chance(0.5) { side.to_owned() } else { format!("to the {side}") });
    let amounts: &[&str] = match degrees {
        d if d < 65.0 => &["slightly", "a little", "forty five degrees"],
        d if d < 112.0 => &["ninety degrees", "by a quarter turn", "by ninety degrees"],
        d if d < 155.0 => &["more than a quarter turn", "by one hundred thirty five degrees"],
        d if d < 250.0 => &["all the way around", "by a half turn", "one hundred eighty degrees"],
        _ => &["in a full circle", "by a full turn", "three hundred sixty degrees"],
    };
    phrase.say_at_times(0.75, amounts, rng);
}

fn say_arc(phrase: &mut Phrase, side: Side, degrees: f32, rng: &mut impl Draw) {
    let shapes: &[&str] = match degrees {
        d if d < 130.0 => &["in a curve", "in an arc", "along a bend"],
        d if d < 250.0 => &["in a half circle", "in a wide curve", "in a semicircle"],
        _ => &["in a circle", "in a full circle", "around in a circle"],
    };
    let direction = match side {
        Side::Left => ["to the left", "counterclockwise"],
        Side::Right => ["to the right", "clockwise"],
    };
    phrase.say(rng.one_of(shapes));
    phrase.say(rng.one_of(&direction));
}

fn of_jump(jump: &Jump, rng: &mut impl Draw) -> Phrase {
    let verbs: &[Verb] = if jump.height < 0.16 { &HOP } else { &JUMP };
    let mut phrase = Phrase::new(verbs, rng);
    phrase.say_extreme(jump.height, (0.14, 0.4, "a little"), (0.28, 0.6, "high"), rng);
    match jump.aim {
        Aim::Up => phrase.say(rng.one_of(&["up", "up and down", "in place", "into the air"])),
        Aim::Forward if jump.distance > 0.6 => phrase.say("far forward"),
        Aim::Forward => phrase.say("forward"),
        Aim::Back => phrase.say(rng.one_of(&["backward", "backwards"])),
        Aim::Sideways(side) => phrase.say(format!("to the {}", side.word())),
        Aim::Spin(side) => phrase.say(format!("with a spin to the {}", side.word())),
    }
    phrase.say_times(jump.count, rng);
    phrase
}

fn of_kick(kick: &Kick, rng: &mut impl Draw) -> Phrase {
    let mut phrase = Phrase::new(&[("kicks", "kicking")], rng);
    phrase.say_extreme(kick.angle, (0.85, 0.8, "low"), (1.35, 0.8, "high"), rng);
    if kick.sideways {
        phrase.say("to the side");
    } else {
        phrase.say_at_times(0.4, &["forward", "in front", "into the air"], rng);
    }
    if rng.chance(0.85) {
        let part = rng.one_of(&["leg", "foot"]);
        phrase.say(format!("with the {} {part}", kick.leg.word()));
    }
    phrase.say_times(kick.repeats.count, rng);
    phrase
}

fn hands(hands: Hands, rng: &mut impl Draw) -> String {
    let part = rng.one_of(&["hand", "arm"]);
    match hands {
        Hands::Both => format!("both {part}s"),
        Hands::One(side) if rng.chance(0.85) => format!("the {} {part}", side.word()),
        Hands::One(_) => format!("one {part}"),
    }
}

/// A verb, a circumstance unless it is empty, and a count.
fn of_repeats(verbs: &[Verb], told: &str, count: u32, rng: &mut impl Draw) -> Phrase {
    let mut phrase = Phrase::new(verbs, rng);
    if !told.is_empty() {
        phrase.say(told);
    }
    phrase.say_times(count, rng);
    phrase
}

fn of_stretch(out: f32, rng: &mut impl Draw) -> Phrase {
    let mut phrase = Phrase::new(&STRETCH, rng);
    let sideways = ["out to the sides and up", "sideways above the head"];
    let forward = ["forward and up", "straight up above the head"];
    phrase.say(rng.one_of(if out.round() > 0.5 { &sideways } else { &forward }));
    phrase
}

fn of_wave(wave: &Wave, rng: &mut impl Draw) -> Phrase {
    let mut phrase = Phrase::new(&[("waves", "waving")], rng);
    if rng.chance(0.9) {
        let with = if rng.chance(0.3) { "with " } else { "" };
        phrase.say(format!("{with}{}", hands(wave.hands, rng)));
    }
    let (low, high) = ((0.25, 0.5, "in front of the chest"), (0.7, 0.7, "above the head"));
    phrase.say_extreme(wave.height, low, high, rng);
    phrase.say_times(wave.repeats.count, rng);
    phrase
}

fn of_punch(punch: &Punch, rng: &mut impl Draw) -> Phrase {
    let mut phrase = Phrase::new(&PUNCH, rng);
    if punch.alternates && punch.repeats.count > 1 {
        phrase.say("with both fists");
    } else if rng.chance(0.8) {
        phrase.say(format!("with the {} fist", punch.first.word()));
    }
    phrase.say_times(punch.repeats.count, rng);
    phrase
}

fn of_sit(sit: &Sit, rng: &mut impl Draw) -> Phrase {
    let mut phrase = Phrase::new(&SIT, rng);
    phrase.say_at_times(0.3, &["on a chair", "on a stool", "on a bench"], rng);
    if sit.hold > 2.0 && rng.chance(0.4) {
        phrase.say("for a while");
    }
    if sit.rises {
        phrase.say_at_times(0.8, &["and gets up", "and rises again", "and gets back up"], rng);
    }
    phrase
}

// Phrases of actions.

/// A verb as in "she walks" and as in "before walking".
pub type Verb = (&'static str, &'static str);

const WALK: [Verb; 4] =
    [("walks", "walking"), ("walks", "walking"), ("strolls", "strolling"), ("paces", "pacing")];
const RUN: [Verb; 3] = [("runs", "running"), ("runs", "running"), ("jogs", "jogging")];
const SPRINT: [Verb; 2] = [("runs", "running"), ("sprints", "sprinting")];
const BACK: [Verb; 3] = [
    ("walks backward", "walking backward"),
    ("walks backwards", "walking backwards"),
    ("backs up", "backing up"),
];
const SIDEWAYS: [Verb; 3] = [
    ("sidesteps", "sidestepping"),
    ("steps sideways", "stepping sideways"),
    ("shuffles sideways", "shuffling sideways"),
];
const TURN: [Verb; 3] = [("turns", "turning"), ("turns", "turning"), ("rotates", "rotating")];
const JUMP: [Verb; 3] = [("jumps", "jumping"), ("jumps", "jumping"), ("leaps", "leaping")];
const HOP: [Verb; 2] = [("jumps", "jumping"), ("hops", "hopping")];
const STAND: [Verb; 3] = [
    ("stands still", "standing still"),
    ("waits", "waiting"),
    ("stands in place", "standing in place"),
];
const LOOK: [Verb; 2] = [("looks around", "looking around"), ("looks about", "looking about")];
const STRETCH: [Verb; 3] = [
    ("raises both arms", "raising both arms"),
    ("lifts the arms", "lifting the arms"),
    ("stretches the arms", "stretching the arms"),
];
const SQUAT: [Verb; 2] = [("squats", "squatting"), ("crouches down", "crouching down")];
const SIT: [Verb; 2] = [("sits down", "sitting down"), ("takes a seat", "taking a seat")];
const PUNCH: [Verb; 2] = [("punches", "punching"), ("throws punches", "throwing punches")];
