//! From laws and a budget to a configuration: pure functions over values.
//!
//! `Laws → raw values at C → projected onto C → nearest buildable shape`, gathered in a
//! [`Prediction`]. Laws of N and D also tell the loss of a model that is not the best one for its
//! FLOPs: [`predict_sized`].
//!
//! # Example
//!
//! ```
//! use isoflop_laws::laws::scamo;
//! use isoflop_laws::predict::{PredictOptions, predict};
//!
//! // What ScaMo's published laws say of 1e18 FLOPs.
//! let best = predict(&scamo(), 1e18, &PredictOptions::default())?;
//! let [size, vocab, tokens] =
//!     [best.at.params_nonvocab, best.at.params_vocab, best.at.tokens].map(Option::unwrap);
//! assert!((6.0 * (size + vocab) * tokens / 1e18 - 1.0).abs() < 1e-6, "N and D spend the budget");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod at_budget;
mod codebook;
mod error;
mod opinion;
mod optimum;
mod options;
mod project;
mod shapes;
mod sized;
mod spread;
mod together;
mod types;
mod warnings;

pub use codebook::Codebook;
pub use error::PredictError;
pub use optimum::predict;
pub use options::{FlopCount, PredictOptions};
pub use project::{Allocation, project};
pub use shapes::{Shape, default_ladder, ladder_of};
pub use sized::{ModelSize, SizedIntervals, SizedOptimum, SizedPrediction, predict_sized};
pub use types::{Intervals, PredictedShape, Prediction, Raw, Together, Weighed};
