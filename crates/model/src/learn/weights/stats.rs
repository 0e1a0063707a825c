//! Statistics of features beside the weights of a module that normalises by them.

use super::{HostTensor, Source, Sources, Weights, WeightsError};
use crate::data::FeatureStats;
use crate::motion::N_FEATURES;

const MEAN: &str = "stats.mean";
const STD: &str = "stats.std";

/// Puts statistics beside weights that are to be written.
pub fn insert_stats(tensors: &mut Sources, stats: &FeatureStats) {
    for (name, values) in [(MEAN, &stats.mean), (STD, &stats.std)] {
        let tensor = HostTensor { shape: vec![values.len()], values: values.clone() };
        tensors.insert(name.to_string(), Source::Host(tensor));
    }
}

/// Takes them out of weights that were read.
///
/// # Errors
/// [`WeightsError::Mismatch`] where they are not there.
pub fn take_stats(tensors: &mut Weights) -> Result<FeatureStats, WeightsError> {
    let mut vector = |name: &str| {
        let missing = || WeightsError::Mismatch {
            name: name.to_string(),
            expected: vec![N_FEATURES],
            found: "missing".to_string(),
        };
        tensors.remove(name).map(|tensor| tensor.values).ok_or_else(missing)
    };
    Ok(FeatureStats { mean: vector(MEAN)?, std: vector(STD)? })
}

/// Puts a number among the tensors, in single precision.
pub fn insert_number(tensors: &mut Sources, name: &str, number: f64) {
    let tensor = HostTensor { shape: vec![1], values: vec![number as f32] };
    tensors.insert(name.to_string(), Source::Host(tensor));
}

/// Takes a number out of weights that were read, as short as single precision writes it: 29.97 is not
/// 29.969999; `None` where it is not there.
pub fn take_number(tensors: &mut Weights, name: &str) -> Option<f64> {
    let number = *tensors.remove(name)?.values.first()?;
    number.to_string().parse().ok()
}
