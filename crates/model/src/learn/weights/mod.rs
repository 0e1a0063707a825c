//! A module's parameters as named tensors, and safetensors files of such tensors.

use std::borrow::Cow;
use std::collections::BTreeMap;

use burn::tensor::Tensor;

use crate::files::FileError;

mod file;
mod module;
mod stats;
#[cfg(test)]
mod tests;

pub use file::{load, save};
pub use module::{into_module, of_module};
pub use stats::{insert_number, insert_stats, take_number, take_stats};

/// A tensor on the host, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct HostTensor {
    pub shape: Vec<usize>,
    pub values: Vec<f32>,
}

/// Host tensors by name.
pub type Weights = BTreeMap<String, HostTensor>;

/// A tensor to be written, which comes to the host when its turn comes: a checkpoint takes the memory
/// of one tensor, not of all.
#[derive(Clone, Debug)]
pub enum Source {
    Host(HostTensor),
    Device { shape: Vec<usize>, flat: Box<Tensor<1>> },
}

/// Tensors to be written, by name.
pub type Sources = BTreeMap<String, Source>;

impl Source {
    /// A tensor of any device and number of dimensions.
    pub fn of<const D: usize>(tensor: Tensor<D>) -> Self {
        let shape = tensor.dims().to_vec();
        let n = shape.iter().product::<usize>();
        Self::Device { shape, flat: Box::new(tensor.reshape([n])) }
    }

    /// The tensor on the host.
    pub fn on_host(&self) -> HostTensor {
        HostTensor { shape: self.shape().to_vec(), values: self.values().into_owned() }
    }

    fn shape(&self) -> &[usize] {
        match self {
            Self::Host(HostTensor { shape, .. }) | Self::Device { shape, .. } => shape,
        }
    }

    fn values(&self) -> Cow<'_, [f32]> {
        match self {
            Self::Host(tensor) => Cow::Borrowed(&tensor.values),
            Self::Device { flat, .. } => {
                let values = Tensor::clone(flat).into_data().try_into_vec::<f32>();
                Cow::Owned(values.expect("parameters are f32"))
            }
        }
    }
}

/// Brings tensors to the host, all at once.
pub fn on_host(sources: &Sources) -> Weights {
    sources.iter().map(|(name, source)| (name.clone(), source.on_host())).collect()
}

/// Why weights could not be read or do not fit.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// Their file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The module has a parameter that the weights lack, or of another shape.
    #[error("parameter {name} of shape {expected:?} is {found} in the weights")]
    Mismatch { name: String, expected: Vec<usize>, found: String },
}
