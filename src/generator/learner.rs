//! [`RunLearner`]: a run of any kind of generator as a learner; [`Objective`] is what kinds differ in.

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::error::GeneratorError;
use super::fitness::{check_inputs, check_precision};
use super::kind::{Kind, Network, Objective, Training};
use super::schedule::learning_rate;
use super::sums::SplitLoss;
use super::trained::{LogLine, Trained};
use crate::data::Split;
use crate::learn::adamw::AdamWConfig;
use crate::learn::params::stream;
use crate::learn::{
    Course, LearnError, Learner, LearnerState, Learning, LoadedState, is_due, weights,
};
use crate::plan::RunSpec;
use crate::progress::Progress;
use crate::spec::flops::TRAINING_PER_FORWARD;

/// The stream of a seed from which weights are drawn; epochs take theirs far above.
const WEIGHTS_STREAM: u64 = 0;

/// What a step hides or corrupts takes its ChaCha stream from here on, one stream a step.
const FIRST_STEP_STREAM: u64 = 1 << 33;

/// A training loss this many nats above the uniform model's ends the run.
const DIVERGED_NATS: f64 = 3.0;

/// The numbers from which the weights of a run are drawn.
pub fn weights_rng(spec: &RunSpec) -> ChaCha8Rng {
    stream(spec.seed, WEIGHTS_STREAM)
}

/// The numbers from which a step draws what it hides or corrupts.
pub fn step_rng(spec: &RunSpec, step: usize) -> ChaCha8Rng {
    stream(spec.seed, FIRST_STEP_STREAM + step as u64)
}

/// What to do about a loss that is no number.
const ADVICE: &str = "lower train.lr";

/// A finished run, measured on the test split.
///
/// # Errors
/// Its last update spoilt it.
pub fn trained<'a, O: Objective<'a>>(
    learning: &Learning<RunLearner<'a, O>>,
) -> Result<Trained, GeneratorError> {
    let learner = learning.learner();
    Ok(Trained {
        test: learner.measure(Split::Test, learner.spec.steps)?,
        weights: weights::of_module(learner.weights()),
        log: learner.totals.log.clone(),
        flops_exact: TRAINING_PER_FORWARD * learner.totals.forward_flops,
        wall_s: learning.wall_s(),
    })
}

/// Trains a run of a kind to its end.
///
/// # Errors
/// Codes or device do not suit the run; learning diverged or was stopped.
pub fn learn<'a, K: Kind>(
    training: &Training<'a>,
    progress: &mut Progress,
) -> Result<Learning<RunLearner<'a, K::Objective<'a>>>, GeneratorError> {
    let Training { spec, inputs, device, checkpoints } = *training;
    check_inputs(spec, inputs)?;
    check_precision(spec.precision, device)?;
    let (mut rng, device) = (weights_rng(spec), device.clone().autodiff());
    let network = K::Network::drawn(spec, spec.precision, &mut rng, &device);
    let (objective, totals) = (K::Objective::new(spec, inputs), Totals::default());
    let learner = RunLearner { spec, objective, network, batch_flops: 0.0, totals };
    Ok(Learning::run(learner, &course(spec), Some(checkpoints), progress)?)
}

/// The course of a run.
pub fn course(spec: &RunSpec) -> Course {
    let optimiser = AdamWConfig {
        beta_1: spec.betas[0],
        beta_2: spec.betas[1],
        epsilon: spec.epsilon,
        weight_decay: spec.weight_decay,
        clip_norm: spec.clip_norm,
    };
    Course { steps: spec.steps, optimiser }
}

/// A run of an objective.
pub struct RunLearner<'a, O: Objective<'a>> {
    spec: &'a RunSpec,
    objective: O,
    network: O::Network,
    /// Forward FLOPs of the batch at hand.
    batch_flops: f64,
    totals: Totals,
}

/// Where a run stands, beside its weights and moments.
///
/// The data position is the step: what a step supervises is a pure function of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Totals {
    /// Sum of the losses since the last log line, and their number.
    loss_sum: f64,
    loss_count: usize,
    /// Forward FLOPs done, by the exact count.
    forward_flops: f64,
    log: Vec<LogLine>,
}

impl<'a, O: Objective<'a>> RunLearner<'a, O> {
    /// The loss on a split at a step, which the last update may have spoilt after its own loss was
    /// checked.
    fn measure(&self, split: Split, step: usize) -> Result<SplitLoss, LearnError> {
        let measured = self.objective.split_loss(&self.network, split);
        let (steps, loss) = (self.spec.steps, measured.loss_nats);
        if loss.is_finite() {
            Ok(measured)
        } else {
            Err(LearnError::NonFinite { step, steps, loss, advice: ADVICE })
        }
    }
}

impl<'a, O: Objective<'a>> Learner for RunLearner<'a, O> {
    type Weights = <O::Network as Network>::Weights;

    fn weights(&self) -> &Self::Weights {
        self.network.weights()
    }

    fn set_weights(&mut self, weights: Self::Weights) {
        self.network.set_weights(weights);
    }

    fn loss(&mut self, step: usize) -> Tensor<1> {
        let (batch, forward_flops) = self.objective.batch(&self.network, step);
        self.batch_flops = forward_flops;
        self.network.loss(&batch)
    }

    fn learning_rate(&self, step: usize) -> f64 {
        learning_rate(self.spec, step)
    }

    fn loss_scale(&self) -> f64 {
        self.spec.precision.loss_scale(self.spec.batch_tokens)
    }

    fn ignorant(&self) -> Option<(f64, f64)> {
        Some((self.objective.uniform_nats(), DIVERGED_NATS))
    }

    fn advice(&self) -> &'static str {
        ADVICE
    }

    /// Counts; where it is due, measures the model on the validation split.
    fn after(&mut self, step: usize, loss: f64) -> Result<(), LearnError> {
        self.totals.loss_sum += loss;
        self.totals.loss_count += 1;
        self.totals.forward_flops += self.batch_flops;
        if !is_due(step, self.spec.steps, self.spec.evaluations) {
            return Ok(());
        }
        let val = self.measure(Split::Val, step)?;
        let (spec, totals) = (self.spec, &mut self.totals);
        totals.log.push(LogLine {
            step,
            tokens: step * spec.batch_tokens,
            lr: learning_rate(spec, step - 1),
            train_loss_nats: totals.loss_sum / totals.loss_count as f64,
            val_loss_normalised: val.loss_normalised,
        });
        (totals.loss_sum, totals.loss_count) = (0.0, 0);
        Ok(())
    }

    fn keep(&self) -> LearnerState {
        let note = serde_json::to_value(&self.totals).expect("plain values");
        LearnerState { note, ..LearnerState::default() }
    }

    fn resume(&mut self, saved: LoadedState) -> Option<()> {
        self.totals = serde_json::from_value(saved.note).ok()?;
        Some(())
    }
}
