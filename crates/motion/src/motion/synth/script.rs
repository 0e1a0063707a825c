//! [`Script`]: everything about a clip but its noise, and its captions.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::action::{Act, Action, FOREVER};
use super::manner::{Manner, Posture};
use super::maths::{Draw, Drive, FPS};
use super::phrase::Phrase;

/// Frames of the shortest and the longest clip.
const SHORTEST: usize = 40;
const LONGEST: usize = 196;

/// Frames of one token of every tokenizer: clips are whole numbers of tokens.
const UNIT: usize = 4;

/// The plan of a clip: person, actions and times.
///
/// Sampling takes microseconds; length and captions follow without performing.
#[derive(Clone, Debug, PartialEq)]
pub struct Script {
    pub(super) manner: Manner,
    pub(super) acts: Vec<Act>,
    n_frames: usize,
    /// Seeds of the performance's noise and of the captions' wording.
    pub(super) noise: u64,
    wording: u64,
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

    /// Two or three lower-case captions with the actions in order.
    pub fn captions(&self) -> Vec<String> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.wording);
        (0..rng.int(2, 3)).map(|_| caption(self, &mut rng)).collect()
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

// A script in words: subject, style, actions in their order.

/// A noun and the pronoun for it.
const SUBJECTS: [((&str, &str), f32); 6] = [
    (("person", "the person"), 8.0),
    (("man", "he"), 3.0),
    (("woman", "she"), 2.0),
    (("figure", "the figure"), 1.0),
    (("human", "the human"), 0.7),
    (("guy", "he"), 0.5),
];

/// The position of the style in a caption.
#[derive(Clone, Copy)]
enum Telling {
    Adjective,
    Adverb,
    Closing,
    Nowhere,
}

fn caption(script: &Script, rng: &mut ChaCha8Rng) -> String {
    let (noun, pronoun) = rng.weighted(&SUBJECTS);
    let telling = rng.weighted(&[
        (Telling::Adjective, 3.0),
        (Telling::Adverb, 3.0),
        (Telling::Closing, 2.0),
        (Telling::Nowhere, 1.0),
    ]);
    let style = style_words(&script.manner, telling, rng);
    let mut text = match (&style, telling) {
        (Some(style), Telling::Adjective) => with_article(&format!("{style} {noun}")),
        _ if rng.chance(0.15) => format!("the {noun}"),
        _ => with_article(noun),
    };
    for (i, act) in script.acts.iter().enumerate() {
        let mut phrase = Phrase::of(act, rng);
        if let (0, Telling::Adverb, Some(style)) = (i, telling, &style) {
            phrase.rest.insert(0, style.clone());
        }
        append(&mut text, i, pronoun, &phrase, rng);
    }
    if let (Some(style), Telling::Closing) = (&style, telling) {
        text.push_str(&format!(" in {} {}", with_article(style), rng.one_of(&["way", "manner"])));
    }
    if rng.chance(0.5) {
        text.push('.');
    }
    text
}

/// Adds one action with the words that link it to the text before.
fn append(text: &mut String, i: usize, pronoun: &str, phrase: &Phrase, rng: &mut ChaCha8Rng) {
    const LINKS: [(&str, f32); 6] = [
        (", then", 4.0),
        (" and then", 4.0),
        (" and", 3.0),
        (" before", 1.5),
        (". after that,", 1.0),
        (", after which", 0.7),
    ];
    let link = if i == 0 { "" } else { rng.weighted(&LINKS) };
    text.push_str(link);
    if link.starts_with(". after") || link == ", after which" {
        text.push_str(&format!(" {pronoun}"));
    }
    let (finite, gerund) = phrase.verb;
    let verb = if link == " before" { gerund } else { finite };
    for words in std::iter::once(verb).chain(phrase.rest.iter().map(String::as_str)) {
        text.push_str(&format!(" {words}"));
    }
}

/// The adjective or adverb of the style, with a word for its strength.
fn style_words(manner: &Manner, telling: Telling, rng: &mut ChaCha8Rng) -> Option<String> {
    let pairs = manner.style.words;
    if pairs.is_empty() || matches!(telling, Telling::Nowhere) {
        return None;
    }
    let (adjective, adverb) = rng.one_of(pairs);
    let word = if matches!(telling, Telling::Adverb) { adverb } else { adjective };
    let strength = match manner.strength {
        s if s > 1.08 => rng.one_of(&["very ", "really "]),
        s if s < 0.72 => rng.one_of(&["slightly ", "somewhat "]),
        _ => "",
    };
    // "like a robot" takes no "very".
    Some(if word.contains(' ') { word.to_owned() } else { format!("{strength}{word}") })
}

fn with_article(words: &str) -> String {
    let article = if words.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} {words}")
}
