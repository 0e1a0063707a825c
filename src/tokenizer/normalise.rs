//! Z-normalisation of features, in place, frame after frame, as an architecture sees them.

use crate::data::FeatureStats;
use crate::motion::{POSITIONS, ROOT_HEIGHT};
use crate::spec::ArchitectureSpec;

/// Normalised values of root-relative features lie within ± this.
const BOUND: f32 = 10.0;

/// Columns with the height of each joint but the root's.
fn joint_heights() -> impl Iterator<Item = usize> {
    (POSITIONS.start + 1..POSITIONS.end).step_by(3)
}

/// Features to normalised values and back.
#[derive(Clone, Debug)]
pub struct Normaliser {
    /// Of what is normalised: `[f]`.
    mean: Vec<f32>,
    std: Vec<f32>,
    /// Whether joints stand at their height above the root, and values are bounded.
    relative: bool,
}

impl Normaliser {
    /// That of an architecture, for features with these statistics.
    pub fn new(architecture: &ArchitectureSpec, stats: &FeatureStats) -> Self {
        let relative = architecture.has_relative_heights();
        let mut mean = stats.mean.clone();
        if relative {
            joint_heights().for_each(|column| mean[column] -= stats.mean[ROOT_HEIGHT]);
        }
        Self { mean, std: stats.std.clone(), relative }
    }

    /// Features of a frame.
    pub fn n_features(&self) -> usize {
        self.mean.len()
    }

    /// Mean of what is normalised, `[f]`.
    pub fn mean(&self) -> &[f32] {
        &self.mean
    }

    /// Deviation of each feature, `[f]`.
    pub fn std(&self) -> &[f32] {
        &self.std
    }

    /// (x − mean) / std of each feature; `features` is row-major `[n_frames, f]`.
    pub fn apply(&self, features: &mut [f32]) {
        for frame in features.chunks_exact_mut(self.n_features()) {
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
    }

    /// Inverse of [`Normaliser::apply`], but for what was beyond the bound.
    pub fn undo(&self, features: &mut [f32]) {
        for frame in features.chunks_exact_mut(self.n_features()) {
            for ((x, &mean), &std) in frame.iter_mut().zip(&self.mean).zip(&self.std) {
                *x = *x * std + mean;
            }
            if self.relative {
                let root = frame[ROOT_HEIGHT];
                joint_heights().for_each(|column| frame[column] += root);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_FEATURES;
    use crate::spec::PatchSpec;

    #[test]
    fn heights_above_the_root_come_back_as_heights() {
        let stats = FeatureStats {
            mean: (0..N_FEATURES).map(|i| i as f32 * 0.01).collect(),
            std: vec![0.5; N_FEATURES],
        };
        let frame: Vec<f32> = (0..N_FEATURES).map(|i| (i as f32).sin()).collect();
        let patch = Normaliser::new(&ArchitectureSpec::Patch(PatchSpec::default()), &stats);
        let mut values = frame.clone();
        patch.apply(&mut values);
        // Joint 1 is at 5 (height), the root at 3.
        let expected = ((frame[5] - frame[3]) - (0.05 - 0.03)) / 0.5;
        assert!((values[5] - expected).abs() < 1e-6);
        patch.undo(&mut values);
        assert!(values.iter().zip(&frame).all(|(a, b)| (a - b).abs() < 1e-5));
    }
}
