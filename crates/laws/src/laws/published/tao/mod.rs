//! The vocabulary laws of *Scaling Laws with Vocabulary* (Tao et al. 2024), as its authors computed
//! them.
//!
//! | their approach | here |
//! | --- | --- |
//! | 1: the frontier of loss in compute | [`frontier()`], [`frontier_laws`] |
//! | 2: the derivative of the compute in V | [`derivative_gamma`] |
//! | 3: the loss formula; the units it was fitted in | [`published_units`] |
//!
//! All three rest on f(V), the tokens that a text needs for each character
//! ([`TokensPerCharacter`]). A text's characters H stay as V grows while its tokens D = H f(V) fall,
//! so that a larger vocabulary is paid back. A motion code of fixed rate has no such f.

mod compression;
mod error;
mod frontier;
mod gamma;
mod grid;
mod huber;
mod interpolate;
mod point;
#[cfg(test)]
mod runs;
#[cfg(test)]
mod tests;
mod units;

pub use compression::{TokensPerCharacter, published_width};
pub use error::FrontierError;
pub use frontier::{Criterion, FrontierLaws, Interpolation, frontier, frontier_laws};
pub use gamma::{DERIVATIVE_SIZES, DerivativeGamma, derivative_gamma};
pub use point::FrontierPoint;
pub use units::{PUBLISHED_MIN_FLOPS, in_millions, published_units};

/// Where the Huber loss of a residual in ln N turns linear, in every fit of the paper.
const DELTA: f64 = 1e-3;
