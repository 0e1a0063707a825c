//! [`Learner`]: what learning asks of whatever learns.

use burn::module::Module;
use burn::tensor::Tensor;

use super::adamw::AdamWConfig;
use super::checkpoint::{LearnerState, LoadedState};
use super::error::LearnError;

/// Something that learns by steps of gradient descent.
pub trait Learner {
    /// Its parameters.
    type Weights: Module + Clone;

    /// The parameters as they are.
    fn weights(&self) -> &Self::Weights;

    /// Takes over parameters: those after a step, or those of a checkpoint.
    fn set_weights(&mut self, weights: Self::Weights);

    /// The mean loss of a step's batch, `[1]`; steps count from 0.
    fn loss(&mut self, step: usize) -> Tensor<1>;

    /// The learning rate of a step.
    fn learning_rate(&self, step: usize) -> f64;

    /// What the loss is multiplied by before its gradients are taken, so that none is lost in half
    /// precision; a power of two.
    fn loss_scale(&self) -> f64 {
        1.0
    }

    /// The loss of knowing nothing, and how far above it learning has diverged.
    fn ignorant(&self) -> Option<(f64, f64)> {
        None
    }

    /// What to do where the loss is not a number any more.
    fn advice(&self) -> &'static str;

    /// Is told that a step is done, and of its loss before the update. `step` counts from 1.
    ///
    /// # Errors
    /// A measure that is taken now shows that learning has diverged.
    fn after(&mut self, _step: usize, _loss: f64) -> Result<(), LearnError> {
        Ok(())
    }

    /// Whether learning is over before its last step.
    fn is_over(&self) -> bool {
        false
    }

    /// What it needs to go on from here beside its weights and their moments.
    fn keep(&self) -> LearnerState {
        LearnerState::default()
    }

    /// Takes up what [`Learner::keep`] gave; `None` where it is not that.
    fn resume(&mut self, _: LoadedState) -> Option<()> {
        Some(())
    }
}

/// How long something learns, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    pub steps: usize,
    pub optimiser: AdamWConfig,
}

/// Whether what is done `times` times, spread evenly over `steps`, is due after a step, counted from 1.
pub fn is_due(step: usize, steps: usize, times: usize) -> bool {
    let due = |step: usize| step * times / steps;
    due(step) != due(step - 1)
}
