//! Evaluators: networks that embed motions and captions side by side, and what they are worth.
//!
//! An [`Evaluator`] is trained on the data at hand, since no published one can be had for every data
//! set and representation; a score means something beside scores of the same evaluator alone. Whether it
//! means anything at all, [`Gates`] say: they are measured before any score.

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
