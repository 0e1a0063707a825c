//! A script in words: subject, style, actions in their order.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::manner::Manner;
use super::phrase::Phrase;
use super::random::Draw;
use super::script::Script;

/// A noun and the pronoun for it.
const SUBJECTS: [((&str, &str), f32); 6] = [
    (("person", "the person"), 8.0),
    (("man", "he"), 3.0),
    (("woman", "she"), 2.0),
    (("figure", "the figure"), 1.0),
    (("human", "the human"), 0.7),
    (("guy", "he"), 0.5),
];

/// Where the style is told.
#[derive(Clone, Copy)]
enum Telling {
    Adjective,
    Adverb,
    Closing,
    Nowhere,
}

impl Script {
    /// Two or three captions, lower-case, which tell the actions in their order.
    pub fn captions(&self) -> Vec<String> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.wording);
        (0..rng.int(2, 3)).map(|_| caption(self, &mut rng)).collect()
    }
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
