//! The clips that a tokenizer reads and their captions: in batches, and normalised as an architecture sees
//! them.

use rand_chacha::ChaCha8Rng;

use super::TokenizerError;
use super::halves::Captions;
use crate::data::{DataError, FeatureStats, MotionSource, Split};
use crate::draws::{below, unit};
use crate::motion::{POSITIONS, ROOT_HEIGHT, ROOT_VELOCITY, complete_features};
use crate::spec::TokenizerSpec;
use crate::text::TextStore;

/// Clips, and their captions as vectors for tokenizers that have language.
#[derive(Clone, Copy)]
pub struct Corpus<'a> {
    pub source: &'a dyn MotionSource,
    pub text: Option<&'a TextStore>,
}

impl<'a> Corpus<'a> {
    /// Clips without their captions.
    pub fn wordless(source: &'a dyn MotionSource) -> Self {
        Self { source, text: None }
    }

    /// The captions for a tokenizer; `None` if it has no language.
    ///
    /// # Errors
    /// It has language, but there are no vectors, or they have another width.
    pub(super) fn read_by(
        &self,
        spec: &TokenizerSpec,
    ) -> Result<Option<ReadCaptions<'a>>, TokenizerError> {
        let Some(language) = spec.architecture.language() else { return Ok(None) };
        let store = self.text.ok_or(TokenizerError::NoText)?;
        if store.dim() != language.dim {
            let (found, wanted) = (store.dim(), language.dim);
            return Err(TokenizerError::TextWidth { found, wanted });
        }
        Ok(Some(ReadCaptions { store, drop: language.drop }))
    }
}

/// The captions of a data set, as a tokenizer with language reads them.
#[derive(Clone, Debug)]
pub struct ReadCaptions<'a> {
    store: &'a TextStore,
    /// Probability of dropping a caption in training.
    drop: f64,
}

impl ReadCaptions<'_> {
    /// The captions of clips outside training: clip i shows caption i mod n.
    pub fn of(&self, split: Split, clips: &[usize]) -> Captions {
        let shown = clips.iter().map(|&clip| self.store.shown(split, clip));
        Captions::of(shown, self.store.dim())
    }

    /// The captions of training clips: one of each clip's, or none, as often as the spec says.
    pub fn drawn(&self, clips: &[usize], rng: &mut ChaCha8Rng) -> Captions {
        let drawn = |&clip: &usize| -> &[f32] {
            let captions = self.store.captions(Split::Train, clip);
            let caption = captions[below(rng, captions.len())];
            let is_dropped = unit(rng) < self.drop;
            if is_dropped { &[] } else { self.store.embedding(caption) }
        };
        Captions::of(clips.iter().map(drawn), self.store.dim())
    }
}

// Clips of one length together, so that no clip is padded and none changes another's codes.

/// Frames of a batch, unless a single clip has more.
const FRAMES_AT_ONCE: usize = 2048;

/// Clips of a split that are encoded together.
#[derive(Debug, PartialEq, Eq)]
pub struct ClipBatch {
    /// Clips by their index in the split.
    pub indices: Vec<usize>,
    /// Frames that are used of each: whole tokens.
    pub n_frames: usize,
}

/// All clips of a split, cut to tokens of `stride` frames.
///
/// # Errors
/// If a clip is shorter than a token.
pub fn equal_length_batches(
    source: &dyn MotionSource,
    split: Split,
    stride: usize,
) -> Result<Vec<ClipBatch>, TokenizerError> {
    let whole_tokens = |index| {
        let n_frames = source.n_frames(split, index);
        if n_frames < stride {
            let (clip, split) = (source.clip_id(split, index), split.name());
            return Err(TokenizerError::ShortClip { clip, split, n_frames, stride });
        }
        Ok((n_frames - n_frames % stride, index))
    };
    let clips = (0..source.n_clips(split)).map(whole_tokens);
    let mut clips = clips.collect::<Result<Vec<_>, _>>()?;
    clips.sort_unstable();
    let runs = clips.chunk_by(|a, b| a.0 == b.0);
    let parts = runs.flat_map(|run| run.chunks((FRAMES_AT_ONCE / run[0].0).max(1)));
    let batch = |part: &[(usize, usize)]| ClipBatch {
        indices: part.iter().map(|&(_, index)| index).collect(),
        n_frames: part[0].0,
    };
    Ok(parts.map(batch).collect())
}

impl ClipBatch {
    /// Raw features, clip after clip, row-major `[n_clips, n_frames, n_features]`.
    pub fn features(&self, source: &dyn MotionSource, split: Split) -> Result<Vec<f32>, DataError> {
        let size = self.n_frames * source.stats().mean.len();
        let mut stack = Vec::with_capacity(self.indices.len() * size);
        for &index in &self.indices {
            stack.extend_from_slice(&source.features(split, index)?[..size]);
        }
        Ok(stack)
    }
}

// Z-normalisation of features, frame after frame.

/// Deviations of a root-relative feature that its value lies within.
const BOUND: f32 = 10.0;

/// The root's step to its side, x of [`ROOT_VELOCITY`].
const SIDEWAYS: usize = ROOT_VELOCITY.start;

/// Columns with the height of each joint but the root's.
fn joint_heights() -> impl Iterator<Item = usize> {
    (POSITIONS.start + 1..POSITIONS.end).step_by(3)
}

/// Converts features to the normalised values of a tokenizer, and back.
#[derive(Clone, Debug)]
pub struct Normaliser {
    /// Mean of the normalised features, `[f]`.
    pub mean: Vec<f32>,
    /// Deviation of each feature, `[f]`; the sideways step's is divided by `sideways_scale`.
    pub std: Vec<f32>,
    /// Largest size of each normalised value, `[f]`.
    bounds: Vec<f32>,
    /// Whether joints stand at their height above the root, and values are bounded.
    pub relative: bool,
    /// Features of a frame before it is narrowed to f.
    all: usize,
}

impl Normaliser {
    /// That of a tokenizer, for features with these statistics.
    pub fn new(spec: &TokenizerSpec, stats: &FeatureStats) -> Self {
        let relative = spec.architecture.has_relative_heights();
        let all = stats.mean.len();
        let n_features = spec.representation.n_features(all);
        let [mut mean, mut std] =
            [&stats.mean, &stats.std].map(|values| values[..n_features].to_vec());
        if relative {
            joint_heights().for_each(|column| mean[column] -= stats.mean[ROOT_HEIGHT]);
        }
        let mut bounds = vec![if relative { BOUND } else { f32::INFINITY }; n_features];
        if n_features > SIDEWAYS {
            let scale = spec.training.sideways_scale as f32;
            std[SIDEWAYS] /= scale;
            bounds[SIDEWAYS] *= scale;
        }
        Self { mean, std, bounds, relative, all }
    }

    /// Features of a frame.
    pub fn n_features(&self) -> usize {
        self.mean.len()
    }

    /// (x − mean) / std of each feature that is seen, `[n_frames, all]` to `[n_frames, f]`.
    pub fn apply(&self, mut values: Vec<f32>) -> Vec<f32> {
        if self.n_features() < self.all {
            let seen = values.chunks_exact(self.all).map(|frame| &frame[..self.n_features()]);
            values = seen.flatten().copied().collect();
        }
        for frame in values.chunks_exact_mut(self.n_features()) {
            if self.relative {
                let root = frame[ROOT_HEIGHT];
                joint_heights().for_each(|column| frame[column] -= root);
            }
            let scales = self.mean.iter().zip(&self.std).zip(&self.bounds);
            for (x, ((&mean, &std), &bound)) in frame.iter_mut().zip(scales) {
                *x = ((*x - mean) / std).clamp(-bound, bound);
            }
        }
        values
    }

    /// Inverse of [`Normaliser::apply`], but for what was beyond the bound; features that are not seen
    /// are made of the others, clip after clip of `n_frames` frames, `fps` a second.
    pub fn undo(&self, mut values: Vec<f32>, n_frames: usize, fps: f64) -> Vec<f32> {
        for frame in values.chunks_exact_mut(self.n_features()) {
            for ((x, &mean), &std) in frame.iter_mut().zip(&self.mean).zip(&self.std) {
                *x = *x * std + mean;
            }
            if self.relative {
                let root = frame[ROOT_HEIGHT];
                joint_heights().for_each(|column| frame[column] += root);
            }
        }
        if self.n_features() == self.all {
            return values;
        }
        let clips = values.chunks(n_frames * self.n_features());
        clips.flat_map(|clip| complete_features(clip, fps)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_FEATURES;
    use crate::spec::{ArchitectureSpec, PatchSpec, Representation, TokenizerTraining};
    use crate::tokenizer::testing::Waves;

    #[test]
    fn clips_of_one_length_share_batches_up_to_the_limit() {
        let source = Waves::new(&[40, 44, 1000, 40, 1000, 41, 1000], 1);
        let batches = equal_length_batches(&source, Split::Test, 4).unwrap();
        let batch = |indices: &[usize], n_frames| ClipBatch { indices: indices.into(), n_frames };
        let expected =
            [batch(&[0, 3, 5], 40), batch(&[1], 44), batch(&[2, 4], 1000), batch(&[6], 1000)];
        assert_eq!(batches, expected);
    }

    #[test]
    fn a_clip_shorter_than_a_token_is_named() {
        let source = Waves::new(&[40, 12], 1);
        let error = equal_length_batches(&source, Split::Val, 16).unwrap_err().to_string();
        assert!(error.contains("clip val-1") && error.contains("12 frames"), "{error}");
    }

    fn normaliser(representation: Representation) -> Normaliser {
        let stats = FeatureStats {
            mean: (0..N_FEATURES).map(|i| i as f32 * 0.01).collect(),
            std: vec![0.5; N_FEATURES],
        };
        let architecture = ArchitectureSpec::Patch(PatchSpec::default());
        let spec = TokenizerSpec { architecture, representation, ..TokenizerSpec::default() };
        Normaliser::new(&spec, &stats)
    }

    #[test]
    fn heights_above_the_root_come_back_as_heights() {
        let frame: Vec<f32> = (0..N_FEATURES).map(|i| (i as f32).sin()).collect();
        let patch = normaliser(Representation::Full);
        let values = patch.apply(frame.clone());
        // Joint 1 is at 5 (height), the root at 3.
        let expected = ((frame[5] - frame[3]) - (0.05 - 0.03)) / 0.5;
        assert!((values[5] - expected).abs() < 1e-6);
        let back = patch.undo(values, 1, 20.0);
        assert!(back.iter().zip(&frame).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn a_sideways_step_counts_by_its_factor_and_comes_back() {
        let scaled = |sideways_scale| {
            let architecture = ArchitectureSpec::Patch(PatchSpec::default());
            let training = TokenizerTraining { sideways_scale, ..TokenizerTraining::of_patches() };
            let spec = TokenizerSpec { architecture, training, ..TokenizerSpec::default() };
            let (mean, std) = (vec![0.25; N_FEATURES], vec![0.5; N_FEATURES]);
            Normaliser::new(&spec, &FeatureStats { mean, std })
        };
        let frame: Vec<f32> = (0..N_FEATURES).map(|i| (i as f32).cos()).collect();
        let (plain, wide) = (scaled(1.0), scaled(4.0));
        let (once, values) = (plain.apply(frame.clone()), wide.apply(frame.clone()));
        assert!((values[SIDEWAYS] - 4.0 * once[SIDEWAYS]).abs() < 1e-5);
        assert_eq!(values[SIDEWAYS + 1..], once[SIDEWAYS + 1..]);
        let back = wide.undo(values, 1, 20.0);
        assert!(back.iter().zip(&frame).all(|(a, b)| (a - b).abs() < 1e-5));
        // What lies far out is cut at the same place.
        let mut far = frame;
        far[SIDEWAYS] = 1e3;
        let cut = |normaliser: &Normaliser| {
            normaliser.undo(normaliser.apply(far.clone()), 1, 20.0)[SIDEWAYS]
        };
        assert!((cut(&plain) - cut(&wide)).abs() < 1e-4);
    }

    #[test]
    fn the_features_that_are_not_seen_are_made_of_those_that_are() {
        let narrow = normaliser(Representation::Meng67);
        let frames: Vec<f32> = (0..4 * N_FEATURES).map(|i| (i as f32 * 0.7).sin()).collect();
        let values = narrow.apply(frames.clone());
        assert_eq!((values.len(), narrow.n_features()), (4 * 67, 67));
        let back = narrow.undo(values, 2, 20.0);
        assert_eq!(back.len(), frames.len());
        for (back, frame) in back.chunks(N_FEATURES).zip(frames.chunks(N_FEATURES)) {
            assert!(back[..67].iter().zip(frame).all(|(a, b)| (a - b).abs() < 1e-5));
        }
        // Clips do not see one another.
        let seen = |part: &[f32]| {
            let known = part.chunks(N_FEATURES).flat_map(|row| &row[..67]).copied();
            complete_features(&known.collect::<Vec<f32>>(), 20.0)
        };
        let alone = seen(&back[2 * N_FEATURES..]);
        let off = back[2 * N_FEATURES..].iter().zip(&alone).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f32::max) < 1e-4);
    }
}
