//! The input of an evaluator: [`Rows`] of motions and captions, by a [`Seen`], in [`Pairs`] of a [`Pool`]; and the trait
//! of its kinds, [`Networks`].

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::EvaluatorError;
use super::corruption::{Corruption, Motion};
use crate::data::{FeatureStats, MotionSource, Split};
use crate::draws::{below, distinct, stream, unit};
use crate::motion::{POSITIONS, VELOCITIES, complete_features};
use crate::ops::SequenceLayout;
use crate::progress::moved;
use crate::spec::{EvaluatorFeatures, EvaluatorSpec};
use crate::text::{HashedNgrams, TextEncoder};

// [`Rows`]: sequences of vectors, one after another.

/// Sequences, each of one vector or more.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// `[rows of all sequences, channels]`, row-major.
    pub values: Vec<f32>,
    /// Rows of each sequence.
    pub lengths: Vec<usize>,
}

impl Rows {
    /// Sequences of vectors of so many channels.
    pub fn of<'a>(sequences: impl IntoIterator<Item = &'a [f32]>, channels: usize) -> Self {
        let mut rows = Self::default();
        for sequence in sequences {
            rows.values.extend_from_slice(sequence);
            rows.lengths.push(sequence.len() / channels);
        }
        rows
    }

    /// These sequences, and others of as many channels behind them.
    #[must_use]
    pub fn and(&self, others: &Self) -> Self {
        let mut all = self.clone();
        all.values.extend_from_slice(&others.values);
        all.lengths.extend_from_slice(&others.lengths);
        all
    }

    /// Sequences in which every row sees every other, with one more before the first.
    pub fn summarised(&self) -> Arc<SequenceLayout> {
        let lengths: Vec<usize> = self.lengths.iter().map(|length| length + 1).collect();
        Arc::new(SequenceLayout::new(&lengths, &lengths).expect("each has its summary"))
    }

    /// The rows of each sequence behind row `summary`, in the order of [`Rows::summarised`].
    pub fn order(&self, summary: u32) -> Arc<[u32]> {
        let of = |range: Range<u32>| std::iter::once(summary).chain(range);
        self.ranges().flat_map(of).collect()
    }

    /// The index of each sequence's summary among those rows.
    pub fn summaries(&self) -> Arc<[u32]> {
        self.ranges().zip(0..).map(|(range, before)| range.start + before).collect()
    }

    fn ranges(&self) -> impl Iterator<Item = Range<u32>> {
        self.lengths.iter().scan(0, |end, length| {
            let start = *end;
            *end += *length as u32;
            Some(start..*end)
        })
    }
}

// Motions and captions as rows.

/// Normalised values lie within ± this, unless others trained the evaluator without bounds.
const BOUND: f32 = 10.0;

/// Deviation of a joint's change of velocity from frame to frame, as a share of the deviation of its velocity: 0.36 on
/// bandai-motion.
const ACCELERATION: f32 = 0.4;

/// How an evaluator sees motions: by its spec and the statistics of its training split.
#[derive(Clone, Debug)]
pub struct Seen {
    pub spec: EvaluatorSpec,
    /// The normalisation.
    pub stats: FeatureStats,
    /// Frames per second.
    pub fps: f64,
}

impl Seen {
    /// Features of a frame that are seen.
    pub fn n_features(&self) -> usize {
        self.spec.representation.n_features(self.stats.mean.len())
    }

    /// Numbers of a row.
    pub fn channels(&self) -> usize {
        self.spec.frames() * self.n_features()
    }

    /// Rows of a window.
    pub fn window_rows(&self) -> usize {
        self.spec.window / self.spec.frames()
    }

    /// The first window of frames, or all whole rows if there are fewer.
    pub fn first_window<'a>(&self, frames: &'a [f32]) -> &'a [f32] {
        let rows = frames.len() / self.channels();
        &frames[..rows.min(self.window_rows()) * self.channels()]
    }

    /// The frames of a motion, `[T, all features]` row-major and raw, as rows are made of.
    ///
    /// # Errors
    /// It has other features, or fewer frames than a row.
    pub fn frames(&self, features: &[f32]) -> Result<Vec<f32>, EvaluatorError> {
        self.checked(features).map(|features| self.as_seen(features))
    }

    /// The same of the first window alone, whose last frame knows nothing of those behind it.
    ///
    /// # Errors
    /// As [`Seen::frames`].
    pub fn first_frames(&self, features: &[f32]) -> Result<Vec<f32>, EvaluatorError> {
        let features = self.checked(features)?;
        let row = self.spec.frames() * self.stats.mean.len();
        let rows = (features.len() / row).min(self.window_rows());
        Ok(self.as_seen(&features[..rows * row]))
    }

    fn checked<'a>(&self, features: &'a [f32]) -> Result<&'a [f32], EvaluatorError> {
        let all = self.stats.mean.len();
        if !features.len().is_multiple_of(all) {
            return Err(EvaluatorError::Features { values: features.len(), wanted: all });
        }
        let (n_frames, least) = (features.len() / all, self.spec.frames());
        if n_frames < least {
            Err(EvaluatorError::TooShort { n_frames, least })
        } else {
            Ok(features)
        }
    }

    fn as_seen(&self, features: &[f32]) -> Vec<f32> {
        match self.spec.representation {
            EvaluatorFeatures::Moving => self.standard(&self.moving(features)),
            _ => self.standard(features),
        }
    }

    /// The features that follow from the root and the joints' positions.
    fn moving(&self, features: &[f32]) -> Vec<f32> {
        let frames = features.chunks_exact(self.stats.mean.len());
        let known: Vec<f32> = frames.flat_map(|frame| &frame[..POSITIONS.end]).copied().collect();
        complete_features(&known, self.fps)
    }

    /// The columns that are seen, normalised.
    fn standard(&self, features: &[f32]) -> Vec<f32> {
        let FeatureStats { mean, std } = &self.stats;
        let bound = if self.spec.loaded.is_some() { f32::INFINITY } else { BOUND };
        let (all, bounded) = (mean.len(), |value: f32| value.clamp(-bound, bound));
        let columns = self.spec.representation.columns(all);
        let mut values = Vec::with_capacity(features.len() / all * self.n_features());
        let mut frames = features.chunks_exact(all).peekable();
        while let Some(frame) = frames.next() {
            let seen = columns.iter().cloned().flatten();
            values.extend(seen.map(|i| bounded((frame[i] - mean[i]) / std[i])));
            if self.spec.representation == EvaluatorFeatures::Moving {
                let next = frames.peek().unwrap_or(&frame);
                let change = |i: usize| (next[i] - frame[i]) / (std[i] * ACCELERATION);
                values.extend(VELOCITIES.map(|i| bounded(change(i))));
            }
        }
        values
    }
}

/// Vectors of the words of a caption, `[n_words, word_dim]` row-major, at least one.
pub fn words(caption: &str, spec: &EvaluatorSpec) -> Vec<f32> {
    let encoder = HashedNgrams::new(spec.word_dim, spec.max_words);
    encoder.encode(caption).expect("hashed n-grams have vectors of every caption")
}

// [`Pool`]: clips and their captions in memory, in the evaluator's form.

/// The stream of the corruption of the first clip, far above those of steps.
const FIRST_COPY_STREAM: u64 = 1 << 40;

/// Motions and captions of a batch, side by side.
#[derive(Clone, Debug)]
pub struct Pairs {
    pub motions: Rows,
    /// The first of these motions, corrupted.
    pub corrupted: Rows,
    pub captions: Rows,
    /// Equal where captions are.
    pub caption_ids: Vec<u32>,
}

/// Clips of a split.
pub struct Pool<'a> {
    seen: &'a Seen,
    /// Normalised.
    clips: Vec<Vec<f32>>,
    /// A corrupted copy of each clip; none if the evaluator learns from true motions alone.
    corrupted: Vec<Vec<f32>>,
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
            seen.frames(&source.features(split, clip)?)
        };
        let clips = chosen.par_iter().map(load).collect::<Result<_, _>>()?;
        let (fps, least) = (seen.fps, seen.spec.frames());
        let worse = |&clip: &usize| {
            moved();
            let (features, stats) = (&source.features(split, clip)?, &seen.stats);
            let motion = Motion { features, stats, fps, least };
            seen.frames(&Corruption::any(
                &motion,
                &mut stream(seen.spec.seed, FIRST_COPY_STREAM + clip as u64),
            ))
        };
        let copied: &[usize] = if seen.spec.n_corrupted() > 0 { &chosen } else { &[] };
        let corrupted = copied.par_iter().map(worse).collect::<Result<_, _>>()?;
        let (captions, words) = captions_of(source, split, &chosen, &seen.spec);
        Ok(Self { seen, clips, corrupted, captions, words })
    }

    /// A batch of different clips: a random window of each, and a random caption, of which some words
    /// are left out.
    pub fn drawn(&self, rng: &mut ChaCha8Rng) -> Pairs {
        let spec = &self.seen.spec;
        let clips = distinct(self.clips.len(), spec.batch, rng);
        let windows: Vec<_> = clips.iter().map(|&clip| (clip, self.window(clip, rng))).collect();
        let pick = |&clip: &usize| self.captions[clip][below(rng, self.captions[clip].len())];
        let caption_ids: Vec<u32> = clips.iter().map(pick).collect();
        let thinned = |&id: &u32| thinned(&self.words[id as usize], spec, rng);
        let captions: Vec<Vec<f32>> = caption_ids.iter().map(thinned).collect();
        self.pairs(&windows, captions.iter().map(Vec::as_slice), caption_ids)
    }

    /// Clips with a window of each, beside captions.
    fn pairs<'b>(
        &self,
        windows: &[(usize, Range<usize>)],
        captions: impl IntoIterator<Item = &'b [f32]>,
        caption_ids: Vec<u32>,
    ) -> Pairs {
        let (channels, n_corrupted) = (self.seen.channels(), self.seen.spec.n_corrupted());
        let of = |all: &[Vec<f32>], most: usize| {
            let some = windows.iter().take(most);
            Rows::of(some.map(|(clip, window)| &all[*clip][window.clone()]), channels)
        };
        Pairs {
            motions: of(&self.clips, windows.len()),
            corrupted: of(&self.corrupted, n_corrupted),
            captions: Rows::of(captions, self.seen.spec.word_dim),
            caption_ids,
        }
    }

    /// All clips in batches: the first window of each, and one caption. A partial batch is kept if it has at least two
    /// clips.
    pub fn batches(&self) -> Vec<Pairs> {
        let clips: Vec<usize> = (0..self.clips.len()).collect();
        let batches = clips.chunks(self.seen.spec.batch).filter(|batch| batch.len() > 1);
        let own = |&clip: &usize| self.captions[clip][clip % self.captions[clip].len()];
        let plain = |clips: &[usize]| {
            let ids: Vec<u32> = clips.iter().map(own).collect();
            let first = |&clip: &usize| (clip, 0..self.seen.first_window(&self.clips[clip]).len());
            let windows: Vec<_> = clips.iter().map(first).collect();
            self.pairs(&windows, ids.iter().map(|&id| &self.words[id as usize][..]), ids.clone())
        };
        batches.map(plain).collect()
    }

    /// A random window of a clip, in whole rows that begin at any frame; as many rows as it has of a shorter one.
    fn window(&self, clip: usize, rng: &mut ChaCha8Rng) -> Range<usize> {
        let (own, channels, width) =
            (self.clips[clip].len(), self.seen.channels(), self.seen.n_features());
        let taken = self.seen.window_rows().min(own / channels) * channels;
        let start = below(rng, (own - taken) / width + 1) * width;
        start..start + taken
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
    let mut id_of = |caption| {
        *ids.entry(caption).or_insert_with_key(|caption| {
            all.push(words(caption, spec));
            all.len() as u32 - 1
        })
    };
    let captions = clips.iter().map(|&clip| {
        moved();
        source.captions(split, clip).into_iter().map(&mut id_of).collect()
    });
    (captions.collect(), all)
}

/// A caption without some of its words, but for its end.
fn thinned(caption: &[f32], spec: &EvaluatorSpec, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let n = caption.len() / spec.word_dim;
    let words = caption.chunks_exact(spec.word_dim).enumerate();
    let kept = words.filter(|(place, _)| unit(rng) >= spec.word_drop || place + 1 == n);
    kept.flat_map(|(_, word)| word).copied().collect()
}

/// Embeds motions and captions into vectors that are close for matching pairs.
pub trait Networks {
    /// A vector of each motion, `[n, e]`.
    fn motions(&self, rows: &Rows) -> Tensor<2>;

    /// A vector of each caption, `[n, e]`.
    fn captions(&self, rows: &Rows) -> Tensor<2>;

    /// The training loss of a batch, `[1]`, with dropout drawn from `rng`.
    fn loss(&self, pairs: &Pairs, rng: Option<&mut ChaCha8Rng>) -> Tensor<1>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sequence_stands_behind_its_summary() {
        let rows = Rows::of([&[1.0, 2.0][..], &[3.0, 4.0, 5.0, 6.0]], 2);
        assert_eq!(rows.lengths, [1, 2]);
        assert_eq!(rows.order(3)[..], [3, 0, 3, 1, 2]);
        assert_eq!(rows.summaries()[..], [0, 2]);
        let layout = rows.summarised();
        assert_eq!((layout.n_rows(), layout.visible(1, 0)), (5, 3));
    }
}
