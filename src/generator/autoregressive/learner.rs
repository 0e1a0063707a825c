//! [`Autoregressive`]: the transformer as a learner, on the batches of a run.

use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use super::batch::Batch;
use super::evaluate::split_loss;
use super::schedule::learning_rate;
use super::stream::TokenStream;
use super::transformer::{Model, Transformer};
use crate::data::Split;
use crate::generator::{Inputs, LogLine, SplitLoss};
use crate::learn::adamw::AdamWConfig;
use crate::learn::{Course, LearnError, Learner, LearnerState, LoadedState};
use crate::plan::RunSpec;
use crate::spec::flops::exact_of_sequence;

/// The stream of a seed from which weights are drawn; epochs take theirs far above.
const WEIGHTS_STREAM: u64 = 0;

/// A training loss this many nats above the uniform model's ends the run.
const DIVERGED_NATS: f64 = 3.0;

/// What to do about a loss that is no number.
const ADVICE: &str = "lower train.lr";

/// A run of the transformer.
pub struct Autoregressive<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
    model: Model,
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

/// A model with the weights of a seed, to be trained on `device` in the run's precision.
pub(super) fn fresh(spec: &RunSpec, device: &Device) -> Model {
    let mut rng = ChaCha8Rng::seed_from_u64(spec.seed);
    rng.set_stream(WEIGHTS_STREAM);
    let model = Model::init(spec.shape(), spec.n_vocab(), &mut rng, &device.clone().autodiff());
    model.in_precision(spec.precision)
}

/// The course of a run.
pub(super) fn course(spec: &RunSpec) -> Course {
    let optimiser = AdamWConfig {
        beta_1: spec.betas[0],
        beta_2: spec.betas[1],
        epsilon: spec.epsilon,
        weight_decay: spec.weight_decay,
        clip_norm: spec.clip_norm,
    };
    Course { steps: spec.steps, optimiser }
}

impl<'a> Autoregressive<'a> {
    /// A run before its first step.
    pub fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>, device: &Device) -> Self {
        let stream = TokenStream::new(inputs.tokens, inputs.text, spec.seed);
        let (batch_flops, totals) = (0.0, Totals::default());
        Self { spec, inputs, stream, model: fresh(spec, device), batch_flops, totals }
    }

    /// Forward FLOPs done, by the exact count.
    pub fn forward_flops(&self) -> f64 {
        self.totals.forward_flops
    }

    /// The measures on the validation split so far.
    pub fn log(&self) -> &[LogLine] {
        &self.totals.log
    }

    /// The model without gradients.
    pub fn frozen(&self) -> Model {
        self.model.frozen()
    }

    /// The loss on a split at a step, which the last update may have spoilt after its own loss was
    /// checked.
    ///
    /// # Errors
    /// [`LearnError::NonFinite`].
    pub fn measure(
        &self,
        model: &Model,
        split: Split,
        step: usize,
    ) -> Result<SplitLoss, LearnError> {
        let measured = split_loss(model, self.inputs.tokens, self.inputs.text, split);
        let (steps, loss) = (self.spec.steps, measured.loss_nats);
        if loss.is_finite() {
            Ok(measured)
        } else {
            Err(LearnError::NonFinite { step, steps, loss, advice: ADVICE })
        }
    }

    /// Whether the model is measured on the validation split after a step.
    fn is_due(&self, step: usize) -> bool {
        let due = |step: usize| step * self.spec.evaluations / self.spec.steps;
        due(step) != due(step - 1)
    }
}

impl Learner for Autoregressive<'_> {
    type Weights = Transformer;

    fn weights(&self) -> &Transformer {
        &self.model.weights
    }

    fn set_weights(&mut self, weights: Transformer) {
        self.model.weights = weights;
    }

    fn device(&self) -> &Device {
        self.model.device()
    }

    fn loss(&mut self, step: usize) -> Tensor<1> {
        let n = self.spec.batch_tokens;
        let batch = self.stream.batch(step * n, n);
        self.batch_flops = forward_flops(self.spec, &batch);
        self.model.loss(&batch)
    }

    fn learning_rate(&self, step: usize) -> f64 {
        learning_rate(self.spec, step)
    }

    fn loss_scale(&self) -> f64 {
        self.spec.precision.loss_scale(self.spec.batch_tokens)
    }

    fn ignorant(&self) -> Option<(f64, f64)> {
        Some((((self.spec.n_vocab() + 1) as f64).ln(), DIVERGED_NATS))
    }

    fn advice(&self) -> &'static str {
        ADVICE
    }

    /// Counts; where it is due, measures the model on the validation split.
    fn after(&mut self, step: usize, loss: f64) -> Result<(), LearnError> {
        self.totals.loss_sum += loss;
        self.totals.loss_count += 1;
        self.totals.forward_flops += self.batch_flops;
        if !self.is_due(step) {
            return Ok(());
        }
        let val = self.measure(&self.model.frozen(), Split::Val, step)?;
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

/// Multiply-adds of a batch, times two: each sequence at its own length, the head per target.
fn forward_flops(spec: &RunSpec, batch: &Batch) -> f64 {
    let layout = &batch.layout;
    let head = 2.0 * (spec.shape().d_model * (spec.n_vocab() + 1)) as f64;
    let blocks = (0..layout.n_sequences()).map(|i| {
        let prefix = layout.prefix(i) as f64;
        let targets = layout.len(i) as f64 - prefix + 1.0;
        exact_of_sequence(spec.shape(), spec.n_vocab(), prefix, targets) - targets * head
    });
    blocks.sum::<f64>() + batch.targets.len() as f64 * head
}
