//! [`Kind`]: the trait of generators, and a run of any kind as a learner.

use std::f64::consts::PI;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::inputs::{GeneratorError, Inputs, check_inputs, check_precision};
use super::losses::SplitLoss;
use super::sampling::Sampler;
use crate::data::Split;
use crate::draws::stream;
use crate::learn::adamw::AdamWConfig;
use crate::learn::weights::{self, Sources};
use crate::learn::{
    Checkpoints, Course, LearnError, Learner, LearnerState, Learning, LoadedState, is_due,
};
use crate::progress::{LogLine, Progress};
use crate::spec::flops::TRAINING_PER_FORWARD;
use crate::spec::{Precision, RunSpec};

/// The specification of a training, its input, and the path of its state.
#[derive(Clone, Copy)]
pub struct Training<'a> {
    pub spec: &'a RunSpec,
    pub inputs: &'a Inputs<'a>,
    pub device: &'a Device,
    pub checkpoints: &'a Checkpoints<'a>,
}

/// A model of codes.
pub trait Network {
    /// Its parameters.
    type Weights: Module + Clone;

    /// The input of a step.
    type Batch;

    /// The model of a run with drawn parameters; on an autodiff device it can be trained.
    fn drawn(spec: &RunSpec, precision: Precision, rng: &mut ChaCha8Rng, device: &Device) -> Self;

    /// The parameters as they are.
    fn weights(&self) -> &Self::Weights;

    /// Takes over parameters.
    fn set_weights(&mut self, weights: Self::Weights);

    /// Mean cross-entropy over the supervised codes of a batch, in nats, `[1]`.
    fn loss(&self, batch: &Self::Batch) -> Tensor<1>;
}

/// The training inputs and the evaluation of a kind of generator.
pub trait Objective<'a> {
    /// The model.
    type Network: Network;

    /// That of a run.
    fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self;

    /// A step's batch, a pure function of the step, which counts from 0; and its forward FLOPs, by the
    /// exact count.
    fn batch(&mut self, network: &Self::Network, step: usize) -> (BatchOf<Self::Network>, f64);

    /// The loss of a model as it is on a split.
    fn split_loss(&self, network: &Self::Network, split: Split) -> SplitLoss;

    /// The loss of a uniform guess, in nats.
    fn uniform_nats(&self) -> f64;
}

type BatchOf<N> = <N as Network>::Batch;

/// A kind of generator, as it says of itself.
pub trait Kind: Sync + 'static {
    /// The model.
    type Network: Network;

    /// Its training objective.
    type Objective<'a>: Objective<'a, Network = Self::Network>;

    /// Whether it asks for [`Inputs::scales`].
    const WANTS_SCALES: bool = false;

    /// A trained model that makes motions.
    fn sampler(spec: &RunSpec, network: Self::Network) -> Box<dyn Sampler>;

    /// A step's batch of made-up clips, and how many tokens it supervises.
    fn made_up(spec: &RunSpec, network: &Self::Network) -> (BatchOf<Self::Network>, usize);
}

/// A finished run.
pub struct Trained {
    pub weights: Sources,
    /// On the test split.
    pub test: SplitLoss,
    pub log: Vec<LogLine>,
    /// Training FLOPs by the exact count.
    pub flops_exact: f64,
    /// Seconds, those of earlier processes included.
    pub wall_s: f64,
}

// [`RunLearner`]: a run of any kind of generator as a learner; kinds differ in their [`Objective`].

/// The stream of a seed from which weights are drawn; epochs take theirs far above.
const WEIGHTS_STREAM: u64 = 0;

/// First ChaCha stream for hiding and corruption, one stream per step.
const FIRST_STEP_STREAM: u64 = 1 << 33;

/// A training loss this many nats above the uniform model's ends the run.
const DIVERGED_NATS: f64 = 3.0;

/// The numbers from which the weights of a run are drawn.
pub fn weights_rng(spec: &RunSpec) -> ChaCha8Rng {
    stream(spec.seed, WEIGHTS_STREAM)
}

/// The random numbers of a step for hiding and corruption.
pub fn step_rng(spec: &RunSpec, step: usize) -> ChaCha8Rng {
    stream(spec.seed, FIRST_STEP_STREAM + step as u64)
}

/// Advice for a loss that is not a number.
const ADVICE: &str = "lower train.lr";

/// A finished run, measured on the test split.
///
/// # Errors
/// Its last update diverged.
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

/// The state of a run, besides weights and moments.
///
/// The data position is the step: the targets are a pure function of it.
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

    /// Counts a step; if an evaluation is due, measures the model on the validation split.
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

// The learning rate over a run.

/// The rate of step `step` (from 0): linear warm-up, then half a cosine to the final share, or the
/// peak up to the decay and 1 − √share over it (Hägele et al. 2024, "Scaling Laws and
/// Compute-Optimal Training Beyond Fixed Training Durations").
pub fn learning_rate(spec: &RunSpec, step: usize) -> f64 {
    if step < spec.warmup_steps {
        return spec.lr * (step + 1) as f64 / (spec.warmup_steps + 1) as f64;
    }
    let height = match spec.decay_steps {
        None => 0.5 * (1.0 + (PI * share(spec.warmup_steps, step, spec.steps)).cos()),
        Some(decay) => 1.0 - share(spec.steps - decay, step, spec.steps).sqrt(),
    };
    spec.lr * (spec.final_share + (1.0 - spec.final_share) * height)
}

/// The fraction of `from..to` passed at the beginning of a step; 0 before.
fn share(from: usize, step: usize, to: usize) -> f64 {
    step.saturating_sub(from) as f64 / (to - from).max(1) as f64
}
