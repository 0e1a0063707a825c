//! [`RunLearner`]: a run of any kind of generator as a learner; [`Objective`] is what kinds differ in.

use std::path::Path;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use super::error::GeneratorError;
use super::kind::Training;
use super::schedule::learning_rate;
use super::trained::{LogLine, SplitLoss, Trained};
use crate::data::Split;
use crate::learn::adamw::AdamWConfig;
use crate::learn::{
    Course, LearnError, Learner, LearnerState, Learning, LoadedState, is_due, weights,
};
use crate::plan::RunSpec;
use crate::progress::Progress;
use crate::spec::flops::TRAINING_PER_FORWARD;

/// The stream of a seed from which weights are drawn; epochs take theirs far above.
const WEIGHTS_STREAM: u64 = 0;

/// What a step hides or corrupts takes its ChaCha stream from here on, one stream a step.
pub const FIRST_STEP_STREAM: u64 = 1 << 33;

/// A training loss this many nats above the uniform model's ends the run.
const DIVERGED_NATS: f64 = 3.0;

/// The numbers from which the weights of a run are drawn.
pub fn weights_rng(spec: &RunSpec) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(spec.seed);
    rng.set_stream(WEIGHTS_STREAM);
    rng
}

/// What to do about a loss that is no number.
const ADVICE: &str = "lower train.lr";

/// What a kind of generator makes small, and how it is measured.
pub trait Objective {
    /// Its parameters.
    type Weights: Module + Clone;

    /// The parameters as they are.
    fn weights(&self) -> &Self::Weights;

    /// Takes over parameters.
    fn set_weights(&mut self, weights: Self::Weights);

    /// Where the parameters live, with gradients.
    fn device(&self) -> &Device;

    /// The loss of a step's batch, a pure function of the weights and the step, which counts from 0.
    fn loss(&mut self, step: usize) -> BatchLoss;

    /// The loss of the parameters as they are on a split.
    fn split_loss(&self, split: Split) -> SplitLoss;

    /// The loss of a model that knows nothing but which codes there are, in nats.
    fn uniform_nats(&self) -> f64;
}

/// The loss of a batch, and what it took.
pub struct BatchLoss {
    /// Mean over the supervised tokens, in nats, `[1]`.
    pub loss: Tensor<1>,
    /// Forward FLOPs, by the exact count.
    pub forward_flops: f64,
}

/// Trains a run to its end and measures it on the test split.
///
/// # Errors
/// Learning diverged or was stopped.
pub fn train<O: Objective>(
    objective: O,
    training: &Training,
    progress: &mut Progress,
) -> Result<Trained, GeneratorError> {
    let learning = learn(objective, training, progress)?;
    let learner = learning.learner();
    Ok(Trained {
        test: learner.measure(Split::Test, training.spec.steps)?,
        weights: weights::of_module(learner.weights()),
        log: learner.totals.log.clone(),
        flops_exact: TRAINING_PER_FORWARD * learner.totals.forward_flops,
        wall_s: learning.wall_s(),
    })
}

/// Trains a trunk to its end and writes its state.
///
/// # Errors
/// As [`train`].
pub fn train_trunk<O: Objective>(
    objective: O,
    training: &Training,
    state: &Path,
    progress: &mut Progress,
) -> Result<(), GeneratorError> {
    let learning = learn(objective, training, progress)?;
    Ok(learning.save(state).map_err(LearnError::from)?)
}

fn learn<'a, O: Objective>(
    objective: O,
    training: &Training<'a>,
    progress: &mut Progress,
) -> Result<Learning<RunLearner<'a, O>>, GeneratorError> {
    let Training { spec, checkpoints, .. } = *training;
    let learner = RunLearner::new(spec, objective);
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
pub struct RunLearner<'a, O> {
    spec: &'a RunSpec,
    objective: O,
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

impl<'a, O: Objective> RunLearner<'a, O> {
    /// A run before its first step.
    pub fn new(spec: &'a RunSpec, objective: O) -> Self {
        Self { spec, objective, batch_flops: 0.0, totals: Totals::default() }
    }

    /// The loss on a split at a step, which the last update may have spoilt after its own loss was
    /// checked.
    fn measure(&self, split: Split, step: usize) -> Result<SplitLoss, LearnError> {
        let measured = self.objective.split_loss(split);
        let (steps, loss) = (self.spec.steps, measured.loss_nats);
        if loss.is_finite() {
            Ok(measured)
        } else {
            Err(LearnError::NonFinite { step, steps, loss, advice: ADVICE })
        }
    }
}

impl<O: Objective> Learner for RunLearner<'_, O> {
    type Weights = O::Weights;

    fn weights(&self) -> &O::Weights {
        self.objective.weights()
    }

    fn set_weights(&mut self, weights: O::Weights) {
        self.objective.set_weights(weights);
    }

    fn device(&self) -> &Device {
        self.objective.device()
    }

    fn loss(&mut self, step: usize) -> Tensor<1> {
        let BatchLoss { loss, forward_flops } = self.objective.loss(step);
        self.batch_flops = forward_flops;
        loss
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
