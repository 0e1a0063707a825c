//! Training an evaluator: the same spec and data give the same bits each time, straight or resumed.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};

use super::EvaluatorError;
use super::codec::{AnyNetworks, Evaluator};
use super::seen::{Pairs, Pool, Seen};
use crate::data::{MotionSource, Split};
use crate::draws::stream;
use crate::learn::adamw::AdamWConfig;
use crate::learn::weights;
use crate::learn::{
    Checkpoints, Course as LearningCourse, LearnError, Learner, LearnerState, Learning,
    LoadedState, is_due,
};
use crate::progress::Progress;
use crate::spec::EvaluatorSpec;

/// Streams of a seed; each step has its own.
const WEIGHTS_STREAM: u64 = 0;
const POOL_STREAM: u64 = 1;
const VALIDATION_STREAM: u64 = 2;
const FIRST_STEP_STREAM: u64 = 1 << 33;

/// Clips that it is validated on, at most.
const VALIDATION_CLIPS: usize = 2048;

/// Global norm that gradients are scaled down to.
const CLIP_NORM: f64 = 1.0;

/// An evaluator after its training.
pub struct TrainedEvaluator {
    pub evaluator: Evaluator,
    pub course: Course,
}

/// How training went; nothing of one that is loaded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Course {
    /// The step after which the validation loss was lowest; its weights are kept.
    pub best_step: usize,
    pub log: Vec<ValidationLine>,
    /// Seconds, including earlier processes.
    pub wall_s: f64,
}

/// An evaluator measured on the validation split.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValidationLine {
    pub step: usize,
    /// Mean over the steps since the last line: in nats, or squared distances of the matching networks.
    pub train_loss: f64,
    pub val_loss: f64,
}

/// Trains an evaluator on the training split of `source`, from its checkpoint if there is one.
///
/// # Errors
/// The data hold too few clips or cannot be read, the loss stops being a number, a checkpoint is damaged
/// or cannot be written, or `progress` asks for an end.
pub fn train(
    spec: &EvaluatorSpec,
    source: &dyn MotionSource,
    device: &Device,
    checkpoints: Option<&Checkpoints>,
    progress: &mut Progress,
) -> Result<TrainedEvaluator, EvaluatorError> {
    let (stats, fps) = (source.stats().clone(), f64::from(source.fps()));
    let seen = Seen { spec: spec.clone(), stats, fps };
    let pool = |split, most, of| Pool::load(source, split, &seen, most, &mut stream(spec.seed, of));
    let learner = Contrasting {
        spec,
        train: pool(Split::Train, spec.pool_clips, POOL_STREAM)?,
        val: pool(Split::Val, VALIDATION_CLIPS, VALIDATION_STREAM)?.batches(),
        networks: fresh(spec, seen.n_features(), &device.clone().autodiff()),
        best: None,
        totals: Totals::default(),
    };
    let learning = Learning::run(learner, &course(spec), checkpoints, progress)?;
    let wall_s = learning.wall_s();
    let Contrasting { best, totals, .. } = learning.into_learner();
    let (line, networks) = best.expect("measured after the last step");
    let evaluator = Evaluator::new(networks, seen.clone());
    let course = Course { best_step: line.step, log: totals.log, wall_s };
    Ok(TrainedEvaluator { evaluator, course })
}

/// AnyNetworks before the first step.
pub(super) fn fresh(spec: &EvaluatorSpec, n_features: usize, device: &Device) -> AnyNetworks {
    AnyNetworks::init(spec, n_features, &mut stream(spec.seed, WEIGHTS_STREAM), device)
}

fn course(spec: &EvaluatorSpec) -> LearningCourse {
    let optimiser = AdamWConfig {
        beta_1: 0.9,
        beta_2: 0.99,
        epsilon: 1e-8,
        weight_decay: spec.weight_decay,
        clip_norm: Some(CLIP_NORM),
    };
    LearningCourse { steps: spec.steps, optimiser }
}

/// AnyNetworks that learn to bring motions and their captions together.
struct Contrasting<'a> {
    spec: &'a EvaluatorSpec,
    train: Pool<'a>,
    val: Vec<Pairs>,
    networks: AnyNetworks,
    /// The networks with the lowest validation loss, and that loss.
    best: Option<(ValidationLine, AnyNetworks)>,
    totals: Totals,
}

/// The state of training, besides weights.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Totals {
    loss_sum: f64,
    loss_count: usize,
    log: Vec<ValidationLine>,
}

impl Contrasting<'_> {
    /// Mean over the validation pairs.
    fn val_loss(&self, networks: &AnyNetworks) -> f64 {
        let n: usize = self.val.iter().map(|pairs| pairs.caption_ids.len()).sum();
        let of = |pairs: &Pairs| {
            let loss = networks.loss(pairs, None).into_scalar::<f32>();
            f64::from(loss) * pairs.caption_ids.len() as f64
        };
        self.val.iter().map(of).sum::<f64>() / n as f64
    }
}

impl Learner for Contrasting<'_> {
    type Weights = AnyNetworks;

    fn weights(&self) -> &AnyNetworks {
        &self.networks
    }

    fn set_weights(&mut self, weights: AnyNetworks) {
        self.networks = weights;
    }

    fn loss(&mut self, step: usize) -> Tensor<1> {
        let mut rng = stream(self.spec.seed, FIRST_STEP_STREAM + step as u64);
        let pairs = self.train.drawn(&mut rng);
        self.networks.loss(&pairs, Some(&mut rng))
    }

    fn learning_rate(&self, step: usize) -> f64 {
        self.spec.learning_rate(step)
    }

    fn advice(&self) -> &'static str {
        "lower evaluator.lr, and look for features that are not finite"
    }

    /// If an evaluation is due, measures the networks, and keeps them if they are the best so far.
    fn after(&mut self, step: usize, loss: f64) -> Result<(), LearnError> {
        self.totals.loss_sum += loss;
        self.totals.loss_count += 1;
        if !is_due(step, self.spec.steps, self.spec.evaluations) {
            return Ok(());
        }
        let networks = self.networks.valid();
        let val_loss = self.val_loss(&networks);
        if !val_loss.is_finite() {
            let (steps, loss, advice) = (self.spec.steps, val_loss, self.advice());
            return Err(LearnError::NonFinite { step, steps, loss, advice });
        }
        let train_loss = self.totals.loss_sum / self.totals.loss_count as f64;
        (self.totals.loss_sum, self.totals.loss_count) = (0.0, 0);
        let line = ValidationLine { step, train_loss, val_loss };
        self.totals.log.push(line);
        if self.best.as_ref().is_none_or(|(best, _)| val_loss < best.val_loss) {
            self.best = Some((line, networks));
        }
        Ok(())
    }

    fn keep(&self) -> LearnerState {
        let note = serde_json::to_value(&self.totals).expect("plain values");
        let tensors = self.best.as_ref().map(|(_, networks)| weights::of_module(networks));
        LearnerState { note, tensors: tensors.unwrap_or_default() }
    }

    fn resume(&mut self, saved: LoadedState) -> Option<()> {
        self.totals = serde_json::from_value(saved.note).ok()?;
        let best = self.totals.log.iter().min_by(|a, b| a.val_loss.total_cmp(&b.val_loss));
        if let Some(line) = best.copied() {
            let networks = weights::into_module(self.networks.valid(), saved.tensors).ok()?;
            self.best = Some((line, networks));
        }
        Some(())
    }
}
