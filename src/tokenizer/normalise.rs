//! Z-normalisation of features, in place, frame after frame.

use crate::data::FeatureStats;

/// (x − mean) / std of each feature; `features` is row-major `[n_frames, n_features]`.
pub fn normalise(features: &mut [f32], stats: &FeatureStats) {
    each(features, stats, |x, mean, std| (x - mean) / std);
}

/// Inverse of [`normalise`].
pub fn denormalise(features: &mut [f32], stats: &FeatureStats) {
    each(features, stats, |x, mean, std| x * std + mean);
}

fn each(features: &mut [f32], stats: &FeatureStats, change: impl Fn(f32, f32, f32) -> f32) {
    for frame in features.chunks_exact_mut(stats.mean.len()) {
        for ((x, &mean), &std) in frame.iter_mut().zip(&stats.mean).zip(&stats.std) {
            *x = change(*x, mean, std);
        }
    }
}
