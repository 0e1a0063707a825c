//! [`WindowPool`]: training clips held in memory, and random windows of them.

use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::error::TokenizerError;
use super::normalise::normalise;
use crate::data::{MotionSource, Split};
use crate::learn::params::below;
use crate::progress::moved;
use crate::spec::TokenizerSpec;

/// Normalised clips of at least one window each.
///
/// A procedural source makes a clip anew each time it is asked, so windows are cut from clips
/// that were asked for once.
pub struct WindowPool {
    clips: Vec<Vec<f32>>,
    n_features: usize,
    window: usize,
}

impl WindowPool {
    /// Loads up to `spec.training.pool_clips` clips of the training split, drawn without replacement.
    ///
    /// # Errors
    /// If no clip holds a window, or one cannot be read.
    pub fn load(
        source: &dyn MotionSource,
        spec: &TokenizerSpec,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, TokenizerError> {
        let chosen = choose(usable(source, spec.training.window)?, spec.training.pool_clips, rng);
        let load = |&index: &usize| {
            let mut features = source.features(Split::Train, index)?;
            normalise(&mut features, source.stats());
            moved();
            Ok(features)
        };
        let clips = chosen.par_iter().map(load).collect::<Result<_, TokenizerError>>()?;
        Ok(Self { clips, n_features: source.stats().mean.len(), window: spec.training.window })
    }

    /// `n` windows, row-major `[n, window, n_features]`: a random clip, then a random start.
    pub fn windows(&self, n: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
        let mut values = Vec::with_capacity(n * self.window * self.n_features);
        (0..n).for_each(|_| values.extend_from_slice(self.draw(rng)));
        values
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> &[f32] {
        let clip = &self.clips[below(rng, self.clips.len())];
        let starts = clip.len() / self.n_features - self.window + 1;
        let start = below(rng, starts) * self.n_features;
        &clip[start..start + self.window * self.n_features]
    }
}

/// The training clips that hold a window.
fn usable(source: &dyn MotionSource, window: usize) -> Result<Vec<usize>, TokenizerError> {
    let n_clips = source.n_clips(Split::Train);
    let frames = |index: usize| source.n_frames(Split::Train, index);
    let usable: Vec<usize> = (0..n_clips).filter(|&index| frames(index) >= window).collect();
    if usable.is_empty() {
        let longest = (0..n_clips).map(frames).max().unwrap_or(0);
        return Err(TokenizerError::NoWindow { window, n_clips, longest });
    }
    Ok(usable)
}

/// `n` of `indices` at most, in ascending order.
fn choose(mut indices: Vec<usize>, n: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let n = n.min(indices.len());
    for i in 0..n {
        let j = i + below(rng, indices.len() - i);
        indices.swap(i, j);
    }
    indices.truncate(n);
    indices.sort_unstable();
    indices
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tokenizer::testing::Waves;
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn short_clips_are_left_out_and_none_at_all_is_an_error() {
        let source = Waves::new(&[16, 40, 12, 24], 2);
        assert_eq!(usable(&source, 20).unwrap(), [1, 3]);
        let error = usable(&source, 48).unwrap_err().to_string();
        assert!(error.contains("48 frames") && error.contains("40"), "{error}");
    }

    #[test]
    fn a_pool_is_a_subset_without_repeats() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut chosen = choose((0..100).collect(), 40, &mut rng);
        assert_eq!(chosen.len(), 40);
        chosen.dedup();
        assert_eq!(chosen.len(), 40);
        assert_eq!(choose(vec![3, 5], 10, &mut rng), [3, 5]);
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
        let windows = pool.windows(5, &mut rng);
        let size = 8 * pool.n_features;
        assert_eq!(windows.len(), 5 * size);
        let clip = &pool.clips[0];
        for window in windows.chunks_exact(size) {
            assert!((0..clip.len() - size + 1).any(|start| clip[start..start + size] == *window));
        }
    }
}
