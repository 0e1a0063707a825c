//! Z-normalisation of features, in place, frame after frame, as an architecture sees them.

use crate::data::FeatureStats;
use crate::motion::{POSITIONS, ROOT_HEIGHT, complete_features};
use crate::spec::TokenizerSpec;

/// Normalised values of root-relative features lie within ± this.
const BOUND: f32 = 10.0;

/// Columns with the height of each joint but the root's.
fn joint_heights() -> impl Iterator<Item = usize> {
    (POSITIONS.start + 1..POSITIONS.end).step_by(3)
}

/// Features to normalised values of those that a tokenizer sees, and back.
#[derive(Clone, Debug)]
pub struct Normaliser {
    /// Mean of what is normalised, `[f]`.
    pub mean: Vec<f32>,
    /// Deviation of each feature, `[f]`.
    pub std: Vec<f32>,
    /// Whether joints stand at their height above the root, and values are bounded.
    relative: bool,
    /// Features of a frame before it is narrowed to f.
    all: usize,
}

impl Normaliser {
    /// That of a tokenizer, for features with these statistics.
    pub fn new(spec: &TokenizerSpec, stats: &FeatureStats) -> Self {
        let relative = spec.architecture.has_relative_heights();
        let all = stats.mean.len();
        let n_features = spec.representation.n_features(all);
        let [mut mean, std] = [&stats.mean, &stats.std].map(|values| values[..n_features].to_vec());
        if relative {
            joint_heights().for_each(|column| mean[column] -= stats.mean[ROOT_HEIGHT]);
        }
        Self { mean, std, relative, all }
    }

    /// Features of a frame.
    pub fn n_features(&self) -> usize {
        self.mean.len()
    }

    /// (x − mean) / std of each feature that is seen, `[n_frames, all]` to `[n_frames, f]`.
    pub fn apply(&self, features: Vec<f32>) -> Vec<f32> {
        let mut values = self.narrowed(features);
        for frame in values.chunks_exact_mut(self.n_features()) {
            if self.relative {
                let root = frame[ROOT_HEIGHT];
                joint_heights().for_each(|column| frame[column] -= root);
            }
            for ((x, &mean), &std) in frame.iter_mut().zip(&self.mean).zip(&self.std) {
                *x = (*x - mean) / std;
            }
            if self.relative {
                frame.iter_mut().for_each(|x| *x = x.clamp(-BOUND, BOUND));
            }
        }
        values
    }

    /// Inverse of [`Normaliser::apply`], but for what was beyond the bound; features that are not seen
    /// are made of the others, clip after clip of `n_frames` frames.
    pub fn undo(&self, mut values: Vec<f32>, n_frames: usize) -> Vec<f32> {
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
        values.chunks(n_frames * self.n_features()).flat_map(complete_features).collect()
    }

    fn narrowed(&self, features: Vec<f32>) -> Vec<f32> {
        if self.n_features() == self.all {
            return features;
        }
        let seen = features.chunks_exact(self.all).map(|frame| &frame[..self.n_features()]);
        seen.flatten().copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_FEATURES;
    use crate::spec::{ArchitectureSpec, PatchSpec, Representation};

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
        let back = patch.undo(values, 1);
        assert!(back.iter().zip(&frame).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn the_features_that_are_not_seen_are_made_of_those_that_are() {
        let narrow = normaliser(Representation::Meng67);
        let frames: Vec<f32> = (0..4 * N_FEATURES).map(|i| (i as f32 * 0.7).sin()).collect();
        let values = narrow.apply(frames.clone());
        assert_eq!((values.len(), narrow.n_features()), (4 * 67, 67));
        let back = narrow.undo(values, 2);
        assert_eq!(back.len(), frames.len());
        for (back, frame) in back.chunks(N_FEATURES).zip(frames.chunks(N_FEATURES)) {
            assert!(back[..67].iter().zip(frame).all(|(a, b)| (a - b).abs() < 1e-5));
        }
        // Clips do not see one another.
        let seen = |part: &[f32]| {
            let known = part.chunks(N_FEATURES).flat_map(|row| &row[..67]).copied();
            complete_features(&known.collect::<Vec<f32>>())
        };
        let alone = seen(&back[2 * N_FEATURES..]);
        let off = back[2 * N_FEATURES..].iter().zip(&alone).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f32::max) < 1e-4);
    }
}
