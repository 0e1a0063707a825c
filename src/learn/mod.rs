//! One learning loop for whatever learns: optimiser, weights, checkpoints, divergence, resume.
//!
//! A [`Learner`] gives the loss of a step and keeps what its steps need; [`Learning`] does the rest.
//! The same learner gives the same bits each time, straight or resumed.

pub mod adamw;
mod checkpoint;
mod error;
pub mod layers;
mod learner;
mod learning;
pub mod params;
pub mod weights;

pub use checkpoint::{Branch, Checkpoints, LearnerState, LoadedState, step_of};
pub use error::LearnError;
pub use learner::{Course, Learner};
pub use learning::Learning;
