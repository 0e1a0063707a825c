//! The operations of the models that burn composes slowly on the CPU, each in two versions.
//!
//! [`Kernels::Own`] are hand-written for the device `flex`, with hand-written gradients; [`Kernels::Plain`] are composed
//! of burn's operations and run everywhere. Tests compare them with each other and with finite differences.
//!
//! Activations are two-dimensional and packed without padding: the rows of a batch are the positions of its sequences,
//! one sequence after another, described by a [`SequenceLayout`]. Tensors
//! carry their shape as a suffix: n rows, s rows that a loss is taken on, m rows to pick from,
//! d features, f hidden features of the feed-forward layer, u columns before its activation,
//! v codes; for convolutions, k taps and c channels that become o. ∂x is the gradient by x, and g the one by the output.
//!
//! RMSNorm (Zhang and Sennrich 2019) is at the start of each part of the model:
//! RMSNorm(x) = x r γ with r = 1 / √(mean(x²) + ε) in each row;
//! ∂x = r (g γ − x r² mean(g γ x)), ∂γ = Σ over rows of g x r.
//!
//! # Example
//!
//! ```
//! use burn::tensor::Device;
//! use isoflop_model::ops;
//!
//! // Checks products of this build on this device, before any training.
//! ops::check_products(&Device::flex())?;
//! # Ok::<(), isoflop_model::ops::WrongProduct>(())
//! ```

mod device;
mod kernels;
mod layout;
mod operands;
mod own;
mod padded;
mod plain;
mod rope;
#[cfg(test)]
mod tests;

pub use device::{DeviceName, NoDevice, WrongProduct, check_products};
pub use kernels::{HalfFloat, Kernels, adamw, nearest, sum_of_squares};
pub use layout::{BlockSequence, CrossLayout, LayoutError, SequenceLayout};
pub use operands::{
    Activation, AttentionOptions, AttentionWeights, Convolution, CrossOptions, FeedForwardWeights,
    HeadWeights, RowLosses, Taps,
};
pub use own::{AdamWStep, vectors};
pub use plain::{Joining, KeyValues};
pub use rope::Rope;
