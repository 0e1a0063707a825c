//! Evaluators: networks that embed motions and captions side by side, and what they are worth.
//!
//! An [`Evaluator`] is trained on the data at hand, since no published one can be had for every data
//! set and representation; a score means something beside scores of the same evaluator alone. Whether it
//! means anything at all, [`Gates`] say: they are measured before any score.
//!
//! # Example
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use burn::tensor::Device;
//! use isoflop_motion::data::{self, Split};
//! use isoflop_model::evaluator::train;
//! use isoflop_spec::spec::{EvaluatorSection, EvaluatorSpec};
//! use isoflop_spec::spec::{Clips, DataSection};
//!
//! let section = DataSection { clips: Clips::Count(16), ..DataSection::default() };
//! let source = data::open(&section, None)?;
//! let small = EvaluatorSection { width: Some(16), layers: Some(1), heads: Some(1), ..Default::default() };
//! let spec = EvaluatorSpec { dim: 16, steps: 2, evaluations: 1, batch: 4, pool_clips: 8, ..small.spec() };
//! let mut no_progress = |_| ControlFlow::Continue(());
//! let trained = train(&spec, &*source, &Device::flex(), None, &mut no_progress)?;
//! let walk = source.features(Split::Test, 0)?;
//! let embedded = trained.evaluator.motions([walk.as_slice()])?;
//! assert_eq!(embedded.dim(), 16);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod caption;
mod codec;
mod corruption;
mod error;
mod gates;
mod kind;
mod matching;
mod motion_clip;
mod networks;
mod pool;
mod report;
mod rows;
mod scored;
mod seen;
mod train;
mod truth;
mod verdict;

pub use codec::Evaluator;
pub use corruption::Corruption;
pub use error::EvaluatorError;
pub use gates::{Corrupted, Gates, SameCaption, Swapped, halves_fid, measure};
pub use report::{EvaluatorReport, table};
pub use scored::{MotionScores, OneScore};
pub use train::{Course, TrainedEvaluator, ValidationLine, train};
pub use truth::{Embedded, Truth, swapped};
pub use verdict::Verdict;

#[cfg(test)]
mod tests;
