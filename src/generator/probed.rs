//! [`Probed`]: a model on made-up clips that stay the same, whose steps can be timed.

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::kind::Probe;
use super::learner::course;
use crate::learn::{Course, LearnError, Learner, Learning};
use crate::plan::RunSpec;

/// A model, and a batch that it is shown again and again.
pub trait Still {
    /// Its parameters.
    type Weights: Module + Clone;

    /// The parameters as they are.
    fn weights(&self) -> &Self::Weights;

    /// Takes over parameters.
    fn set_weights(&mut self, weights: Self::Weights);

    /// Where the parameters live, with gradients.
    fn device(&self) -> &Device;

    /// The loss of the batch, `[1]`.
    fn loss(&self) -> Tensor<1>;
}

/// A small run of a spec's kind, at a rate of 0.
pub struct Probed<S: Still> {
    learning: Learning<Resting<S>>,
    flops: f64,
}

impl<S: Still> Probed<S> {
    /// A run of a spec's optimiser, whose steps count for so many FLOPs.
    pub fn new(spec: &RunSpec, still: S, flops: f64) -> Self {
        let course = Course { steps: usize::MAX, ..course(spec) };
        Self { learning: Learning::new(Resting(still), &course), flops }
    }
}

impl<S: Still> Probe for Probed<S> {
    fn step(&mut self) -> Result<(), LearnError> {
        self.learning.step().map(|_| ())
    }

    fn flops(&self) -> f64 {
        self.flops
    }
}

/// A learner whose steps change nothing.
struct Resting<S>(S);

impl<S: Still> Learner for Resting<S> {
    type Weights = S::Weights;

    fn weights(&self) -> &S::Weights {
        self.0.weights()
    }

    fn set_weights(&mut self, weights: S::Weights) {
        self.0.set_weights(weights);
    }

    fn device(&self) -> &Device {
        self.0.device()
    }

    fn loss(&mut self, _: usize) -> Tensor<1> {
        self.0.loss()
    }

    fn learning_rate(&self, _: usize) -> f64 {
        0.0
    }

    fn advice(&self) -> &'static str {
        "the device gives wrong numbers"
    }
}
