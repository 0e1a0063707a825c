//! From laws and a budget to a configuration: pure functions over values.
//!
//! `Laws → raw values at C → projected onto C → nearest buildable shape`, gathered in a
//! [`Prediction`].

mod at_budget;
mod brief;
mod codebook;
mod error;
mod flop_count;
mod opinion;
mod optimum;
mod options;
mod project;
mod shapes;
mod spread;
mod text;
mod types;
mod warnings;

pub use brief::{brief, cells};
pub use codebook::Codebook;
pub use error::PredictError;
pub use flop_count::{CountedBy, FlopCount, SixNd};
pub use optimum::predict;
pub use options::PredictOptions;
pub use project::{Allocation, project};
pub use shapes::{Shape, default_ladder};
pub use text::{said, text};
pub use types::{Intervals, PredictedShape, Prediction, Raw};
