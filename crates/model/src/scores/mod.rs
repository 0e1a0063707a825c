//! Scores of motions: how far a set of embeddings is from another, whether texts find their motions,
//! how different motions are, and what can be seen of a motion without an embedding.
//!
//! Embeddings come from an evaluator; a score means something beside scores of the same evaluator
//! alone.
//!
//! # Example
//!
//! ```
//! use isoflop_model::scores::{Embeddings, frechet_distance};
//!
//! let truth = Embeddings::new(vec![0.0, 1.0, 2.0, 3.0], 1)?;
//! let moved = Embeddings::new(vec![2.0, 3.0, 4.0, 5.0], 1)?;
//! let fid = frechet_distance(&truth, &moved)?;
//! assert!((fid - 4.0).abs() < 1e-9, "the square of the step: {fid}");
//! # Ok::<(), isoflop_model::scores::ScoreError>(())
//! ```

mod embeddings;
mod error;
mod frechet;
mod physics;
pub mod published;
mod rank;
mod repeated;
mod retrieval;
mod spread;

pub use embeddings::{Embeddings, distance};
pub use error::ScoreError;
pub use frechet::{Gaussian, frechet_distance};
pub use physics::{Physics, physics};
pub use rank::{RankCorrelation, rank_correlation};
pub use repeated::Repeated;
pub use retrieval::{POOL, Retrieval, cosine_score, retrieval};
pub use spread::{diversity, multimodality};
