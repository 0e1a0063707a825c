//! How much a data set holds.

use std::collections::{BTreeMap, HashSet};

use serde::Serialize;

use super::source::{MotionSource, Split};

/// Frames of a bin of the histogram of lengths.
pub const LENGTH_BIN: usize = 20;
/// Words of a bin of the histogram of captions.
pub const WORDS_BIN: usize = 5;

/// What a split, or all of them, hold.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    pub clips: usize,
    pub frames: usize,
    pub hours: f64,
    /// Codes of all clips at one, two, four and eight frames a code, end tokens not counted.
    pub tokens: BTreeMap<usize, usize>,
    pub captions: usize,
    pub distinct_captions: usize,
    /// Different words of the captions.
    pub words: usize,
    pub words_a_caption: f64,
}

/// A data set in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Counted {
    pub fps: f32,
    pub train: Tally,
    pub val: Tally,
    pub test: Tally,
    pub all: Tally,
    /// Clips of all splits by their frames: the first of each bin of 20.
    pub lengths: BTreeMap<usize, usize>,
    /// Captions of all splits by their words: the first of each bin of 5.
    pub caption_words: BTreeMap<usize, usize>,
}

/// Frames a code that are counted.
const RATES: [usize; 4] = [1, 2, 4, 8];

/// Counts every clip.
pub fn count(data: &dyn MotionSource) -> Counted {
    let [train, val, test] = Split::ALL.map(|split| tally(data, &[split]));
    let mut lengths = BTreeMap::new();
    let mut caption_words = BTreeMap::new();
    for (split, index) in data.clips(&Split::ALL) {
        *lengths.entry(data.n_frames(split, index) / LENGTH_BIN * LENGTH_BIN).or_default() += 1;
        for caption in data.captions(split, index) {
            let words = caption.split_whitespace().count();
            *caption_words.entry(words / WORDS_BIN * WORDS_BIN).or_default() += 1;
        }
    }
    let all = tally(data, &Split::ALL);
    Counted { fps: data.fps(), train, val, test, all, lengths, caption_words }
}

fn tally(data: &dyn MotionSource, splits: &[Split]) -> Tally {
    let mut tally = Tally::default();
    let (mut captions, mut words): (HashSet<String>, HashSet<String>) = Default::default();
    let mut n_words = 0;
    for (split, index) in data.clips(splits) {
        let frames = data.n_frames(split, index);
        tally.clips += 1;
        tally.frames += frames;
        RATES.iter().for_each(|rate| *tally.tokens.entry(*rate).or_default() += frames / rate);
        for caption in data.captions(split, index) {
            tally.captions += 1;
            let letters =
                |word: &str| word.trim_matches(|c: char| !c.is_alphanumeric()).to_string();
            let own: Vec<String> = caption.split_whitespace().map(letters).collect();
            n_words += own.len();
            words.extend(own.into_iter().filter(|word| !word.is_empty()));
            captions.insert(caption);
        }
    }
    tally.hours = tally.frames as f64 / f64::from(data.fps()) / 3600.0;
    tally.distinct_captions = captions.len();
    tally.words = words.len();
    tally.words_a_caption = n_words as f64 / tally.captions.max(1) as f64;
    tally
}
