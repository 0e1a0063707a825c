//! [`Pool`]: clips and their captions, held in memory as an evaluator sees them.

use std::collections::HashMap;

use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::caption::words;
use super::error::EvaluatorError;
use super::rows::Rows;
use super::seen::Seen;
use crate::data::{MotionSource, Split};
use crate::learn::params::{below, distinct, unit};
use crate::progress::moved;
use crate::spec::EvaluatorSpec;

/// Motions and captions of a batch, side by side.
#[derive(Clone, Debug)]
pub struct Pairs {
    pub motions: Rows,
    pub captions: Rows,
    /// Equal where captions are.
    pub caption_ids: Vec<u32>,
}

/// Clips of a split.
pub struct Pool<'a> {
    seen: &'a Seen,
    /// Normalised, in whole rows.
    clips: Vec<Vec<f32>>,
    /// The captions of each clip, by id.
    captions: Vec<Vec<u32>>,
    /// The words of each caption.
    words: Vec<Vec<f32>>,
}

impl<'a> Pool<'a> {
    /// `most` clips of a split at most, drawn without replacement, in a random order.
    ///
    /// # Errors
    /// There are fewer than two that hold a row, or one cannot be read.
    pub fn load(
        source: &dyn MotionSource,
        split: Split,
        seen: &'a Seen,
        most: usize,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, EvaluatorError> {
        let usable = usable(source, split, &seen.spec, 2)?;
        let chosen = distinct(usable.len(), most, rng).into_iter().map(|i| usable[i]);
        let chosen: Vec<usize> = chosen.collect();
        let load = |&clip: &usize| {
            moved();
            seen.rows(&source.features(split, clip)?)
        };
        let clips = chosen.par_iter().map(load).collect::<Result<_, _>>()?;
        let (captions, words) = captions_of(source, split, &chosen, &seen.spec);
        Ok(Self { seen, clips, captions, words })
    }

    /// A batch of different clips: a random window of each, and a random caption, of which some words
    /// are left out.
    pub fn drawn(&self, rng: &mut ChaCha8Rng) -> Pairs {
        let spec = &self.seen.spec;
        let clips = distinct(self.clips.len(), spec.batch, rng);
        let windows: Vec<&[f32]> = clips.iter().map(|&clip| self.window(clip, rng)).collect();
        let pick = |&clip: &usize| self.captions[clip][below(rng, self.captions[clip].len())];
        let caption_ids: Vec<u32> = clips.iter().map(pick).collect();
        let thinned = |&id: &u32| thinned(&self.words[id as usize], spec, rng);
        let captions: Vec<Vec<f32>> = caption_ids.iter().map(thinned).collect();
        self.pairs(windows, captions.iter().map(Vec::as_slice), caption_ids)
    }

    fn pairs<'b>(
        &self,
        motions: impl IntoIterator<Item = &'b [f32]>,
        captions: impl IntoIterator<Item = &'b [f32]>,
        caption_ids: Vec<u32>,
    ) -> Pairs {
        Pairs {
            motions: Rows::of(motions, self.seen.channels()),
            captions: Rows::of(captions, self.seen.spec.word_dim),
            caption_ids,
        }
    }

    /// All clips, a batch after another: the first window of each, and one caption. What fills no batch
    /// is one too where it has two clips.
    pub fn batches(&self) -> Vec<Pairs> {
        let clips: Vec<usize> = (0..self.clips.len()).collect();
        let batches = clips.chunks(self.seen.spec.batch).filter(|batch| batch.len() > 1);
        batches.map(|batch| self.plain(batch)).collect()
    }

    fn plain(&self, clips: &[usize]) -> Pairs {
        let own = |&clip: &usize| self.captions[clip][clip % self.captions[clip].len()];
        let caption_ids: Vec<u32> = clips.iter().map(own).collect();
        let motions = clips.iter().map(|&clip| self.seen.first_window(&self.clips[clip]));
        let captions: Vec<&[f32]> =
            caption_ids.iter().map(|&id| self.words[id as usize].as_slice()).collect();
        self.pairs(motions, captions, caption_ids)
    }

    /// A random window of a clip, in whole rows; all of a shorter one.
    fn window(&self, clip: usize, rng: &mut ChaCha8Rng) -> &[f32] {
        let (own, channels) = (&self.clips[clip], self.seen.channels());
        let rows = own.len() / channels;
        let taken = self.seen.window_rows().min(rows);
        let start = below(rng, rows - taken + 1);
        &own[start * channels..(start + taken) * channels]
    }
}

/// The clips of a split that hold a row.
///
/// # Errors
/// There are fewer than `least`.
pub fn usable(
    source: &dyn MotionSource,
    split: Split,
    spec: &EvaluatorSpec,
    least: usize,
) -> Result<Vec<usize>, EvaluatorError> {
    let mut usable: Vec<usize> = (0..source.n_clips(split)).collect();
    usable.retain(|&clip| source.n_frames(split, clip) >= spec.frames());
    let (split, found) = (split.name(), usable.len());
    if found >= least {
        Ok(usable)
    } else {
        Err(EvaluatorError::TooFewClips { split, least, found })
    }
}

/// The ids of the captions of clips, and the words of each id.
fn captions_of(
    source: &dyn MotionSource,
    split: Split,
    clips: &[usize],
    spec: &EvaluatorSpec,
) -> (Vec<Vec<u32>>, Vec<Vec<f32>>) {
    let mut ids: HashMap<String, u32> = HashMap::new();
    let mut all = Vec::new();
    let mut id_of = |caption: String| match ids.get(&caption) {
        Some(&id) => id,
        None => {
            let id = all.len() as u32;
            all.push(words(&caption, spec));
            ids.insert(caption, id);
            id
        }
    };
    let captions = clips.iter().map(|&clip| {
        moved();
        source.captions(split, clip).into_iter().map(&mut id_of).collect()
    });
    let captions = captions.collect();
    (captions, all)
}

/// A caption without some of its words, but for its end.
fn thinned(caption: &[f32], spec: &EvaluatorSpec, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let n = caption.len() / spec.word_dim;
    let words = caption.chunks_exact(spec.word_dim).enumerate();
    let kept = words.filter(|(place, _)| unit(rng) >= spec.word_drop || place + 1 == n);
    kept.flat_map(|(_, word)| word).copied().collect()
}
