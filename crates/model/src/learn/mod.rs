//! One learning loop for whatever learns: optimiser, weights, checkpoints, divergence, resume.
//!
//! A [`Learner`] gives the loss of a step and keeps what its steps need; [`Learning`] does the rest.
//! The same learner gives the same bits each time, straight or resumed.
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
mod checkpoint;
mod error;
pub mod layers;
mod learner;
mod learning;
pub mod params;
pub mod weights;

pub use checkpoint::{Branch, Checkpoints, LearnerState, LoadedState, step_of};
pub use error::LearnError;
pub use learner::{Course, Learner, is_due};
pub use learning::Learning;
