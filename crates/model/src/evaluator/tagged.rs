//! [`Vocabulary`]: captions into rows, by vectors of words and of parts of speech, as Guo et al. (2022) read them.

use std::collections::{BTreeMap, HashMap};

use serde::{Deserialize, Serialize};

use crate::data::{MotionSource, Split};
use crate::learn::weights::{HostTensor, Source, Sources, Weights};

/// Parts of speech, in the order of their vectors. The five that end in `VIP` are words of the lists below.
const PARTS: [&str; 15] = [
    "VERB", "NOUN", "DET", "ADP", "NUM", "AUX", "PRON", "ADJ", "ADV", "Loc_VIP", "Body_VIP",
    "Obj_VIP", "Act_VIP", "Desc_VIP", "OTHER",
];

/// The place of any other part of speech, and of unknown words.
const OTHER: usize = 14;

/// Words that have a part of speech of their own, whatever theirs is in the caption.
const OWN: [(usize, &str); 5] = [
    (
        9,
        "left right clockwise counterclockwise anticlockwise forward back backward up down straight \
         curve",
    ),
    (10, "arm chin foot feet face hand mouth leg waist eye knee shoulder thigh"),
    (11, "stair dumbbell chair window floor car ball handrail baseball basketball"),
    (
        12,
        "walk run swing pick bring kick put squat throw hop dance jump turn stumble stop sit lift \
         lower raise wash stand kneel stroll rub bend balance flap jog shuffle lean rotate spin \
         spread climb",
    ),
    (13, "slowly carefully fast careful slow quickly happy angry sad happily angrily sadly"),
];

/// Stand in for a word without a vector, before the first word, and behind the last.
const UNKNOWN: &str = "unk";
const START: &str = "sos";
const END: &str = "eos";

/// The tensors of a vocabulary.
const VECTORS: &str = "words.vectors";
const TAGS: &str = "words.parts";

/// The words of a vocabulary and of captions, as they are stored.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Words {
    /// In the order of their vectors.
    pub words: Vec<String>,
    /// Captions with their words and parts of speech, as `walk/VERB forward/ADV`.
    #[serde(default)]
    pub captions: BTreeMap<String, String>,
}

/// Vectors of words and of parts of speech.
#[derive(Debug)]
pub struct Vocabulary {
    stored: Words,
    places: HashMap<String, usize>,
    /// `[words, c]`.
    vectors: HostTensor,
    /// `[15, c]`.
    parts: HostTensor,
}

impl Vocabulary {
    /// Takes its tensors out of weights, for rows of `channels`.
    ///
    /// # Errors
    /// A sentence: one is missing or of another shape, or no vector stands for unknown words.
    pub fn take(stored: Words, tensors: &mut Weights, channels: usize) -> Result<Self, String> {
        let mut take = |name: &str, rows: usize| {
            let tensor = tensors.remove(name).ok_or_else(|| format!("{name} is missing"))?;
            let is_so = tensor.shape == [rows, channels];
            is_so.then_some(tensor).ok_or_else(|| format!("{name} is not {rows} × {channels}"))
        };
        let vectors = take(VECTORS, stored.words.len())?;
        let parts = take(TAGS, PARTS.len())?;
        let places = stored.words.iter().cloned().zip(0..).collect::<HashMap<_, _>>();
        if !places.contains_key(UNKNOWN) {
            return Err(format!("the words have no `{UNKNOWN}`, which stands for unknown ones"));
        }
        Ok(Self { stored, places, vectors, parts })
    }

    /// Its words, and the captions that it knows.
    pub fn stored(&self) -> &Words {
        &self.stored
    }

    /// Adds its tensors to weights before writing.
    pub fn insert(&self, tensors: &mut Sources) {
        let own = [(VECTORS, &self.vectors), (TAGS, &self.parts)];
        tensors.extend(own.map(|(name, tensor)| (name.into(), Source::Host(tensor.clone()))));
    }

    /// Learns the words and parts of speech of the captions of the test split.
    pub fn read_captions(&mut self, source: &dyn MotionSource) {
        for clip in 0..source.n_clips(Split::Test) {
            let captions = source.captions(Split::Test, clip);
            let known = captions.into_iter().zip(source.tokens(Split::Test, clip));
            let known = known.filter(|(_, tokens)| !tokens.is_empty());
            known.for_each(|(caption, tokens)| {
                self.stored.captions.entry(caption).or_insert(tokens);
            });
        }
    }

    /// The rows of a caption, `most` with its start and its end; `None` if its words are not known.
    pub fn rows(&self, caption: &str, most: usize) -> Option<Vec<f32>> {
        let tokens = self.stored.captions.get(caption)?;
        let own =
            tokens.split_whitespace().map(|token| token.rsplit_once('/').unwrap_or((token, "")));
        let own = own.take(most.saturating_sub(2));
        let all = std::iter::once((START, "")).chain(own).chain([(END, "")]);
        Some(all.flat_map(|(word, part)| self.row(word, part)).collect())
    }

    /// The sum of the vectors of a word and of its part of speech.
    fn row(&self, word: &str, part: &str) -> impl Iterator<Item = f32> {
        let (place, part) = match self.places.get(word) {
            Some(place) => (*place, part_of(word, part)),
            None => (self.places[UNKNOWN], OTHER),
        };
        let [word, part] = [(&self.vectors, place), (&self.parts, part)].map(|(tensor, row)| {
            let channels = tensor.shape[1];
            tensor.values[row * channels..][..channels].iter()
        });
        word.zip(part).map(|(word, part)| word + part)
    }
}

fn part_of(word: &str, part: &str) -> usize {
    let own = OWN.iter().find(|(_, words)| words.split_whitespace().any(|own| own == word));
    let named = || PARTS.iter().position(|own| *own == part).unwrap_or(OTHER);
    own.map_or_else(named, |(place, _)| *place)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Words have whole numbers as vectors, and parts of speech hundredths.
    fn vocabulary(caption: &str, tokens: &str) -> Vocabulary {
        let words = ["unk", "sos", "eos", "walk", "he", "left", "wave"].map(String::from).to_vec();
        let captions = BTreeMap::from([(caption.to_string(), tokens.to_string())]);
        let column = |n: usize, of: fn(usize) -> f32| HostTensor {
            shape: vec![n, 1],
            values: (0..n).map(of).collect(),
        };
        let vectors = column(words.len(), |i| i as f32);
        let parts = column(15, |i| i as f32 / 100.0);
        let mut tensors = Weights::from([(VECTORS.into(), vectors), (TAGS.into(), parts)]);
        Vocabulary::take(Words { words, captions }, &mut tensors, 1).unwrap()
    }

    #[test]
    fn a_word_is_the_sum_of_its_vector_and_its_part_of_speech() {
        let tokens = "he/PRON wave/VERB walk/NOUN left/ADJ jumps/VERB wave/X";
        let rows = vocabulary("he waves", tokens).rows("he waves", 22).unwrap();
        // Words of the lists have their own part, unknown words and other parts have `OTHER`.
        let expected = [1.14, 4.06, 6.0, 3.12, 5.09, 0.14, 6.14, 2.14];
        assert!(rows.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{rows:?}");
        assert_eq!(rows.len(), expected.len());
    }

    #[test]
    fn a_long_caption_keeps_its_first_words_and_its_end() {
        let words = vocabulary("long", &"he/PRON ".repeat(30));
        let rows = words.rows("long", 22).unwrap();
        assert_eq!((rows.len(), rows[20], rows[21]), (22, 4.06, 2.14));
        assert_eq!(words.rows("unknown", 22), None);
    }
}
