//! The training loop: optimiser, weights, checkpoints, divergence, resume.
//!
//! A [`Learner`] computes the loss of a step and keeps its own state; [`Learning`] does the rest. The same learner gives
//! the same bits each time, straight or resumed.
//!
//! # Example
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use burn::nn::{Linear, LinearConfig};
//!
//! use burn::tensor::{Device, Tensor};
//! use isoflop_model::learn::{Course, Learner, Learning, adamw::AdamWConfig};
//!
//! /// y = 3x, learned from two points.
//! struct Line {
//!     weights: Linear,
//!     device: Device,
//! }
//!
//! impl Learner for Line {
//!     type Weights = Linear;
//!
//!     fn weights(&self) -> &Linear {
//!         &self.weights
//!     }
//!
//!     fn set_weights(&mut self, weights: Linear) {
//!         self.weights = weights;
//!     }
//!
//!     fn loss(&mut self, _step: usize) -> Tensor<1> {
//!         let x = Tensor::<2>::from_data([[1.0], [2.0]], &self.device);
//!         let error = self.weights.forward(x.clone()) - x * 3.0;
//!         (error.clone() * error).mean()
//!     }
//!
//!     fn learning_rate(&self, _step: usize) -> f64 {
//!         0.05
//!     }
//!
//!     fn advice(&self) -> &'static str {
//!         "lower the learning rate"
//!     }
//! }
//!
//! let device = Device::flex().autodiff();
//! let line = Line { weights: LinearConfig::new(1, 1).init(&device), device };
//! let optimiser =
//!     AdamWConfig { beta_1: 0.9, beta_2: 0.95, epsilon: 1e-8, weight_decay: 0.0, clip_norm: None };
//! let course = Course { steps: 200, optimiser };
//! let learning = Learning::run(line, &course, None, &mut |_| ControlFlow::Continue(()))?;
//! let loss = learning.into_learner().loss(0).into_data().try_to_vec::<f32>()?[0];
//! assert!(loss < 0.1, "{loss}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod adamw;
pub mod described;
pub mod layers;
mod learning;
pub mod params;
pub mod weights;

use burn::module::Module;
use burn::tensor::Tensor;
use serde_json::Value;

use crate::failure::FailureKind;
use crate::files::FileError;
use adamw::AdamWConfig;
use weights::{Sources, Weights};

pub use learning::{Branch, Checkpoints, Learning, step_of};

/// Something that learns by steps of gradient descent.
pub trait Learner {
    /// Its parameters.
    type Weights: Module + Clone;

    /// The parameters as they are.
    fn weights(&self) -> &Self::Weights;

    /// Sets parameters: after a step, or from a checkpoint.
    fn set_weights(&mut self, weights: Self::Weights);

    /// The mean loss of a step's batch, `[1]`; steps count from 0.
    fn loss(&mut self, step: usize) -> Tensor<1>;

    /// The learning rate of a step.
    fn learning_rate(&self, step: usize) -> f64;

    /// The factor of the loss before gradients are taken, so that none underflows in half precision; a power of
    /// two.
    fn loss_scale(&self) -> f64 {
        1.0
    }

    /// The loss of knowing nothing, and how far above it learning has diverged.
    fn ignorant(&self) -> Option<(f64, f64)> {
        None
    }

    /// Advice if the loss is not a number.
    fn advice(&self) -> &'static str;

    /// Called after each step with the loss before the update. `step` counts from 1.
    ///
    /// # Errors
    /// An evaluation shows that learning has diverged.
    fn after(&mut self, _step: usize, _loss: f64) -> Result<(), LearnError> {
        Ok(())
    }

    /// Whether learning is over before its last step.
    fn is_over(&self) -> bool {
        false
    }

    /// Its state, besides weights and moments.
    fn keep(&self) -> LearnerState {
        LearnerState::default()
    }

    /// Restores the state of [`Learner::keep`]; `None` if it does not fit.
    fn resume(&mut self, _: LoadedState) -> Option<()> {
        Some(())
    }
}

/// Number of steps and optimiser.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    pub steps: usize,
    pub optimiser: AdamWConfig,
}

/// Whether an action, done `times` times evenly over `steps`, is due after a step, counted from 1.
pub fn is_due(step: usize, steps: usize, times: usize) -> bool {
    let due = |step: usize| step * times / steps;
    due(step) != due(step - 1)
}

/// A learner's state, besides weights and moments.
#[derive(Debug, Default)]
pub struct LearnerState {
    pub note: Value,
    pub tensors: Sources,
}

/// A [`LearnerState`] read from a file.
#[derive(Debug, Default)]
pub struct LoadedState {
    pub note: Value,
    pub tensors: Weights,
}

/// Why learning ended without a result.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// The loss is not a number any more.
    #[error("the loss is {loss} at step {step} of {steps}: {advice}")]
    NonFinite { step: usize, steps: usize, loss: f64, advice: &'static str },
    /// The loss is far above that of a uniform guess.
    #[error(
        "diverged: the loss is {loss:.2} at step {step} of {steps}, {ignorant:.2} would be knowing \
         nothing: {advice}"
    )]
    Diverged { step: usize, steps: usize, loss: f64, ignorant: f64, advice: &'static str },
    /// The caller asked for a stop; a checkpoint was written.
    #[error("stopped at step {step} of {steps}; its checkpoint is written")]
    Stopped { step: usize, steps: usize },
    /// A checkpoint could not be written or read.
    #[error(transparent)]
    File(#[from] FileError),
}

impl LearnError {
    /// The failure of a job that ends with it; `None` for a stop, which is no failure.
    pub fn failure_kind(&self) -> Option<FailureKind> {
        match self {
            Self::NonFinite { .. } | Self::Diverged { .. } => Some(FailureKind::Diverged),
            Self::File(error) => Some(error.failure_kind()),
            Self::Stopped { .. } => None,
        }
    }
}

/// Why something that learns has no result.
#[derive(Clone, Copy, Debug)]
pub enum Cause<'a> {
    /// Learning ended before its end.
    Learn(&'a LearnError),
    /// Anything else.
    Other(FailureKind),
}

/// An error of something that learns.
pub trait TrainingError {
    /// What it is.
    fn cause(&self) -> Cause<'_>;

    /// Why learning ended, if that is the reason.
    fn learn_error(&self) -> Option<&LearnError> {
        if let Cause::Learn(error) = self.cause() { Some(error) } else { None }
    }

    /// The failure of a job that ends with it; `None` for a stop, which is no failure.
    fn failure_kind(&self) -> Option<FailureKind> {
        match self.cause() {
            Cause::Learn(error) => error.failure_kind(),
            Cause::Other(kind) => Some(kind),
        }
    }
}
