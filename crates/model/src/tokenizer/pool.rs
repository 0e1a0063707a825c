//! [`WindowPool`]: training clips in memory, and random windows of them.

use std::ops::Range;
use std::path::Path;

use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::TokenizerError;
use super::corpus::Normaliser;
use super::windows::Windows;
use crate::data::{MotionSource, Split};
use crate::draws::{below, distinct};
use crate::files::FileError;
use crate::files::columns::{NewColumn, write};
use crate::motion::mirror_features;
use crate::progress::moved;
use crate::spec::{TokenizerLoss, TokenizerSpec};

/// Normalised clips.
///
/// A procedural source regenerates a clip at each access, so windows are cut from clips that are generated
/// once.
pub struct WindowPool {
    clips: Vec<Vec<f32>>,
    /// The index of each in the training split; a mirror image has its original's.
    origins: Vec<usize>,
    n_features: usize,
    /// Frames up to and with each clip, if clips are drawn by their frames, and some are shorter than a
    /// window; `None` if each is drawn as often.
    frames_upto: Option<Vec<usize>>,
    /// Clips from here on make half of a step's windows; the number of clips if none do.
    long_from: usize,
}

impl WindowPool {
    /// Loads up to `spec.training.pool_clips` clips of the training split, drawn without replacement, as many of its long
    /// ones, and their mirror images where these are trained on.
    ///
    /// # Errors
    /// If no clip holds a window (or, with the loss of joints, a code), or one cannot be read.
    pub fn load(
        source: &dyn MotionSource,
        spec: &TokenizerSpec,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, TokenizerError> {
        let by_frames = spec.training.loss == TokenizerLoss::Joints;
        let least = if by_frames { spec.stride() } else { spec.training.window };
        let [usable, long] = usable(source, least)?;
        let mut chosen = choose(&usable, spec.training.pool_clips, rng);
        let ordinary = chosen.len();
        if !long.is_empty() {
            chosen.extend(choose(&long, spec.training.pool_clips, rng));
        }
        let normaliser = Normaliser::new(spec, source.stats());
        let load = |&index: &usize| {
            let features = source.features(Split::Train, index)?;
            let mirrored = spec.training.mirror.then(|| mirror_features(&features));
            let clips = [features].into_iter().chain(mirrored);
            let clips: Vec<Vec<f32>> = clips.map(|clip| normaliser.apply(clip)).collect();
            moved();
            Ok(clips)
        };
        let clips = chosen.par_iter().map(load).collect::<Result<Vec<_>, TokenizerError>>()?;
        let images = if spec.training.mirror { 2 } else { 1 };
        let origins = chosen.iter().flat_map(|&index| vec![index; images]).collect();
        let clips: Vec<Vec<f32>> = clips.into_iter().flatten().collect();
        let n_features = normaliser.n_features();
        let mut frames = 0;
        let upto = |clip: &Vec<f32>| {
            frames += clip.len() / n_features;
            frames
        };
        let frames_upto = by_frames.then(|| clips.iter().map(upto).collect());
        let halved = source.metadata().half_long && !long.is_empty();
        let long_from = if halved { images * ordinary } else { clips.len() };
        Ok(Self { clips, origins, n_features, frames_upto, long_from })
    }

    /// Writes all clips as one file of columns, with the statistics of their normalisation.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub fn write(&self, path: &Path, normaliser: &Normaliser) -> Result<(), FileError> {
        let mut offsets = vec![0];
        for clip in &self.clips {
            offsets.push(offsets[offsets.len() - 1] + (clip.len() / self.n_features) as u64);
        }
        let origins: Vec<u64> = self.origins.iter().map(|&origin| origin as u64).collect();
        let (values, long_from) = (self.clips.concat(), [self.long_from as u64]);
        let columns = [
            NewColumn::new("values", &values),
            NewColumn::new("offsets", &offsets),
            NewColumn::new("origins", &origins),
            NewColumn::new("long_from", &long_from),
            NewColumn::new("mean", &normaliser.mean),
            NewColumn::new("std", &normaliser.std),
        ];
        write(path, &columns, None)
    }

    /// `n` windows of `n_frames` frames, at most `spec.training.window`: a random clip, then a random start. The first half
    /// are of the clips that make half of them.
    pub fn windows(&self, n: usize, n_frames: usize, rng: &mut ChaCha8Rng) -> Windows {
        let mut values = Vec::with_capacity(n * n_frames * self.n_features);
        let mut visible = Vec::with_capacity(n * n_frames);
        let mut clips = Vec::with_capacity(n);
        for i in 0..n {
            let (all, is_long) = (self.clips.len(), i < n / 2 && self.long_from < self.clips.len());
            let of = if is_long { self.long_from..all } else { 0..self.long_from };
            let (clip, own) = self.draw(of, n_frames, rng);
            clips.push(self.origins[clip]);
            let missing = n_frames - own.len() / self.n_features;
            values.extend_from_slice(own);
            let last = &own[own.len() - self.n_features..];
            (0..missing).for_each(|_| values.extend_from_slice(last));
            visible.extend((0..n_frames).map(|frame| frame < n_frames - missing));
        }
        Windows { values, visible, n_frames, clips }
    }

    /// One of these clips and a window of it, or all of a clip that is shorter.
    fn draw(&self, of: Range<usize>, window: usize, rng: &mut ChaCha8Rng) -> (usize, &[f32]) {
        let index = match &self.frames_upto {
            None => of.start + below(rng, of.len()),
            Some(upto) => {
                let before = |clip: usize| if clip == 0 { 0 } else { upto[clip - 1] };
                let [first, end] = [of.start, of.end].map(before);
                let frame = first + below(rng, end - first);
                upto.partition_point(|end| *end <= frame)
            }
        };
        let clip = &self.clips[index];
        let n_frames = clip.len() / self.n_features;
        let taken = window.min(n_frames);
        let start = below(rng, n_frames - taken + 1) * self.n_features;
        (index, &clip[start..start + taken * self.n_features])
    }

    /// At most `most` patches of `frames` frames, `frames·f` values each, spread evenly over all clips. Patches of a clip
    /// start at its start, and again half a patch later.
    pub fn patches(&self, frames: usize, most: usize) -> impl Iterator<Item = &[f32]> {
        let size = frames * self.n_features;
        let all = self.n_patches(frames);
        let n = all.min(most);
        // The i-th of n is number ⌊i · all / n⌋, so that as many are taken as are asked for.
        let taken = move |at: &usize| (at * n) % all.max(1) < n;
        let patches = self.halves(frames).flat_map(move |part| part.chunks_exact(size));
        patches.enumerate().filter(move |(at, _)| taken(at)).map(|(_, patch)| patch)
    }

    /// The number of patches of `frames` frames.
    pub fn n_patches(&self, frames: usize) -> usize {
        self.halves(frames).map(|part| part.len() / (frames * self.n_features)).sum()
    }

    /// Each clip from its start, and once more from half a patch later.
    fn halves(&self, frames: usize) -> impl Iterator<Item = &[f32]> {
        let later = (frames > 1).then_some(frames / 2 * self.n_features);
        let starts = [Some(0), later].into_iter().flatten();
        self.clips.iter().flat_map(move |clip| starts.clone().filter_map(|start| clip.get(start..)))
    }
}

/// The training clips that hold so many frames, and the long ones that do.
fn usable(source: &dyn MotionSource, window: usize) -> Result<[Vec<usize>; 2], TokenizerError> {
    let n_clips = source.n_clips(Split::Train);
    let frames = |index: usize| source.n_frames(Split::Train, index);
    let [usable, long] = [0..n_clips, n_clips..n_clips + source.n_long()]
        .map(|all| all.filter(|&index| frames(index) >= window).collect::<Vec<_>>());
    if usable.is_empty() {
        let longest = (0..n_clips).map(frames).max().unwrap_or(0);
        return Err(TokenizerError::NoWindow { window, n_clips, longest });
    }
    Ok([usable, long])
}

/// `n` of `indices` at most, in ascending order.
fn choose(indices: &[usize], n: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let mut chosen: Vec<usize> =
        distinct(indices.len(), n, rng).into_iter().map(|i| indices[i]).collect();
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::TokenizerTraining;
    use crate::tokenizer::testing::Waves;
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn short_clips_are_left_out_and_none_at_all_is_an_error() {
        let source = Waves::new(&[16, 40, 12, 24], 2);
        assert_eq!(usable(&source, 20).unwrap(), [vec![1, 3], vec![]]);
        let error = usable(&source, 48).unwrap_err().to_string();
        assert!(error.contains("48 frames") && error.contains("40"), "{error}");
    }

    #[test]
    fn a_pool_is_a_subset_without_repeats() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut chosen = choose(&Vec::from_iter(0..100), 40, &mut rng);
        assert_eq!(chosen.len(), 40);
        chosen.dedup();
        assert_eq!(chosen.len(), 40);
        assert_eq!(choose(&[3, 5], 10, &mut rng), [3, 5]);
    }

    #[test]
    fn windows_are_whole_runs_of_normalised_frames() {
        let source = Waves::new(&[24], 2);
        let spec = {
            let mut spec = TokenizerSpec::default();
            spec.training.window = 8;
            spec
        };
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let pool = WindowPool::load(&source, &spec, &mut rng).unwrap();
        let windows = pool.windows(5, 8, &mut rng).values;
        let size = 8 * pool.n_features;
        assert_eq!(windows.len(), 5 * size);
        let clip = &pool.clips[0];
        for window in windows.chunks_exact(size) {
            assert!((0..clip.len() - size + 1).any(|start| clip[start..start + size] == *window));
        }
        let short = pool.windows(3, 4, &mut rng);
        assert_eq!((short.values.len(), short.n_visible(), short.n_frames), (3 * 8, 12, 4));
    }

    #[test]
    fn as_many_patches_are_taken_as_are_asked_for_from_all_clips() {
        let source = Waves::new(&[24, 9, 32, 17], 3);
        let spec = TokenizerSpec::default();
        let spec =
            TokenizerSpec { training: TokenizerTraining { window: 8, ..spec.training }, ..spec };
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let pool = WindowPool::load(&source, &spec, &mut rng).unwrap();
        // From the start of each clip, and from its third frame: 6 + 5, 2 + 1, 8 + 7 and 4 + 3.
        assert_eq!(pool.n_patches(4), 36);
        for n in 1..36 {
            assert_eq!(pool.patches(4, n).count(), n);
        }
        assert_eq!(pool.patches(4, 50).count(), 36);
        let four = Vec::from_iter(pool.patches(4, 4).map(<[f32]>::as_ptr));
        let all = Vec::from_iter(pool.patches(4, 36).map(<[f32]>::as_ptr));
        assert_eq!(four, [0, 9, 18, 27].map(|at| all[at]));
    }

    #[test]
    fn half_of_the_windows_are_of_long_clips_where_these_are_to_make_half() {
        for (half_long, loss) in [
            (true, TokenizerLoss::Features),
            (true, TokenizerLoss::Joints),
            (false, TokenizerLoss::Features),
        ] {
            let mut source = Waves::new(&[24, 16, 32, 17, 200, 240], crate::motion::N_FEATURES);
            (source.n_long, source.metadata.half_long) = (2, half_long);
            let mut spec = TokenizerSpec::default();
            (spec.training.window, spec.training.loss) = (8, loss);
            let mut rng = ChaCha8Rng::seed_from_u64(0);
            let pool = WindowPool::load(&source, &spec, &mut rng).unwrap();
            assert_eq!(pool.origins, [0, 1, 2, 3, 4, 5]);
            let of_long = |windows: &[usize]| windows.iter().filter(|clip| **clip > 3).count();
            let windows = pool.windows(60, 8, &mut rng).clips;
            let found = [of_long(&windows[..30]), of_long(&windows[30..])];
            assert_eq!(found == [30, 0], half_long, "{found:?}");
            assert!(half_long || found.iter().all(|n| *n > 0), "{found:?}");
        }
    }

    #[test]
    fn a_window_and_its_image_know_their_clip() {
        let source = Waves::new(&[24, 6, 32], crate::motion::N_FEATURES);
        let mut spec = TokenizerSpec::default();
        (spec.training.window, spec.training.mirror) = (8, true);
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let pool = WindowPool::load(&source, &spec, &mut rng).unwrap();
        assert_eq!(pool.origins, [0, 0, 2, 2], "the short clip holds no window");
        let windows = pool.windows(20, 8, &mut rng);
        assert!(
            windows.clips.iter().all(|clip| [0, 2].contains(clip)) && windows.clips.len() == 20
        );
    }
}
