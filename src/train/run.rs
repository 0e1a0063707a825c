//! The training loop of one run: from a spec and its inputs to losses, resumable at any step.

use std::path::Path;
use std::time::{Duration, Instant};

use burn::optim::GradientsParams;
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::adamw::{AdamW, AdamWConfig};
use super::checkpoint::{self, LogLine, Standing};
use super::error::TrainError;
use super::evaluate::{SplitLoss, split_loss};
use super::fitness::{check_inputs, check_precision};
use super::schedule::learning_rate;
use super::stream::TokenStream;
use super::weights::WeightsError;
use crate::data::Split;
use crate::model::{Batch, Model};
use crate::moving::{Progress, Step};
use crate::plan::RunSpec;
use crate::plan::flops::{TRAINING_PER_FORWARD, exact_of_sequence};
use crate::text::TextStore;
use crate::tokenizer::TokenStore;

/// The stream of a seed from which weights are drawn; epochs take theirs far above.
const WEIGHTS_STREAM: u64 = 0;

/// A training loss this many nats above the uniform model's ends the run.
const DIVERGED_NATS: f64 = 3.0;

/// What a run reads, mapped and shared with the runs beside it.
pub struct Inputs<'a> {
    pub tokens: &'a TokenStore,
    pub text: &'a TextStore,
}

/// A finished run.
pub struct Trained {
    pub model: Model,
    /// On the test split.
    pub test: SplitLoss,
    pub log: Vec<LogLine>,
    /// Training FLOPs by the exact count.
    pub flops_exact: f64,
    /// Seconds, those of earlier processes included.
    pub wall_s: f64,
}

/// Where a run's state lies while it is trained.
#[derive(Clone, Copy)]
pub struct Checkpoints<'a> {
    /// Written now and then; where it is there, the run goes on from it.
    pub path: &'a Path,
    /// Never changes the result.
    pub every: Duration,
    /// What a run begins with that has no checkpoint yet.
    pub branch: Option<Branch<'a>>,
}

/// The end of a trunk, from which runs go on.
#[derive(Clone, Copy)]
pub struct Branch<'a> {
    pub state: &'a Path,
    /// The steps that are done there.
    pub steps: usize,
}

/// Trains a run to its end, from its checkpoint where there is one.
///
/// The checkpoint is removed by the caller, after the record is in place.
pub fn train(
    spec: &RunSpec,
    inputs: &Inputs,
    device: &Device,
    checkpoints: &Checkpoints,
    progress: &mut Progress,
) -> Result<Trained, TrainError> {
    let mut run = Run::start_or_resume(spec, inputs, device, checkpoints)?;
    run.go_on(checkpoints, progress)?;
    run.finish()
}

/// Trains a trunk to its end, from its checkpoint where there is one, and writes its state.
pub fn train_trunk(
    spec: &RunSpec,
    inputs: &Inputs,
    device: &Device,
    checkpoints: &Checkpoints,
    state: &Path,
    progress: &mut Progress,
) -> Result<(), TrainError> {
    let mut run = Run::start_or_resume(spec, inputs, device, checkpoints)?;
    run.go_on(checkpoints, progress)?;
    Ok(run.save(state)?)
}

struct Run<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
    model: Model,
    optimiser: AdamW,
    standing: Standing,
    started: Instant,
}

impl<'a> Run<'a> {
    fn start_or_resume(
        spec: &'a RunSpec,
        inputs: &'a Inputs<'a>,
        device: &Device,
        checkpoints: &Checkpoints,
    ) -> Result<Self, TrainError> {
        check_inputs(spec, inputs)?;
        check_precision(spec.precision, device)?;
        let mut rng = ChaCha8Rng::seed_from_u64(spec.seed);
        rng.set_stream(WEIGHTS_STREAM);
        let model = Model::init(&spec.model, spec.n_vocab, &mut rng, &device.clone().autodiff());
        let model = model.in_precision(spec.precision);
        let optimiser = AdamW::new(optimiser_config(spec));
        let (model, optimiser, standing) = match (checkpoints.path, checkpoints.branch) {
            (own, _) if own.exists() => checkpoint::load(own, model, optimiser)?,
            (_, Some(branch)) => {
                branched(&branch, checkpoint::load(branch.state, model, optimiser)?)?
            }
            (_, None) => (model, optimiser, Standing::default()),
        };
        let stream = TokenStream::new(inputs.tokens, inputs.text, spec.seed);
        Ok(Self { spec, inputs, stream, model, optimiser, standing, started: Instant::now() })
    }

    /// Takes the steps that are left, and writes a checkpoint now and then.
    fn go_on(
        &mut self,
        checkpoints: &Checkpoints,
        progress: &mut Progress,
    ) -> Result<(), TrainError> {
        let (mut saved, steps) = (Instant::now(), self.spec.steps);
        let before = checkpoints.branch.map_or(0, |branch| branch.steps);
        while self.standing.step < steps {
            let began = Instant::now();
            let loss = self.step()?;
            let seconds = began.elapsed().as_secs_f64();
            self.log()?;
            let step = self.standing.step;
            let done = Step { step: step - before, steps: steps - before, loss, seconds };
            if progress(done).is_break() && step < steps {
                self.save(checkpoints.path)?;
                return Err(TrainError::Stopped { step, steps });
            }
            if saved.elapsed() >= checkpoints.every {
                self.save(checkpoints.path)?;
                saved = Instant::now();
            }
        }
        Ok(())
    }

    /// One step; its loss before the update, in nats.
    fn step(&mut self) -> Result<f64, TrainError> {
        let (spec, step) = (self.spec, self.standing.step);
        let batch = self.stream.batch(step * spec.batch_tokens, spec.batch_tokens);
        let loss = self.model.loss(&batch);
        let value = f64::from(loss.clone().into_scalar::<f32>());
        self.check(value)?;
        let scale = spec.precision.loss_scale(batch.targets.len());
        let scaled = if scale == 1.0 { loss } else { loss * scale };
        let gradients = GradientsParams::from_grads(scaled.backward(), &self.model.weights);
        let (weights, rate) = (self.model.weights.clone(), learning_rate(spec, step));
        let (weights, _) = self.optimiser.step_scaled(weights, gradients, scale, rate);
        self.model.weights = weights;
        self.count(&batch, value);
        Ok(value)
    }

    fn check(&self, loss: f64) -> Result<(), TrainError> {
        let (step, steps) = (self.standing.step + 1, self.spec.steps);
        let uniform = ((self.spec.n_vocab + 1) as f64).ln();
        if !loss.is_finite() {
            Err(TrainError::NonFinite { step, steps, loss })
        } else if loss > uniform + DIVERGED_NATS {
            Err(TrainError::Diverged { step, steps, loss, uniform })
        } else {
            Ok(())
        }
    }

    fn count(&mut self, batch: &Batch, loss: f64) {
        self.standing.step += 1;
        self.standing.loss_sum += loss;
        self.standing.loss_count += 1;
        self.standing.forward_flops += forward_flops(self.spec, batch);
    }

    /// Where it is due, measures the model on the validation split.
    fn log(&mut self) -> Result<(), TrainError> {
        let (spec, step) = (self.spec, self.standing.step);
        let due = |step: usize| step * spec.evaluations / spec.steps;
        if due(step) == due(step - 1) {
            return Ok(());
        }
        let val = self.measure(&self.model.frozen(), Split::Val)?;
        let standing = &mut self.standing;
        standing.log.push(LogLine {
            step,
            tokens: step * spec.batch_tokens,
            lr: learning_rate(spec, step - 1),
            train_loss_nats: standing.loss_sum / standing.loss_count as f64,
            val_loss_normalised: val.loss_normalised,
        });
        (standing.loss_sum, standing.loss_count) = (0.0, 0);
        Ok(())
    }

    /// The loss on a split, which the last update may have spoilt after its own loss was checked.
    fn measure(&self, model: &Model, split: Split) -> Result<SplitLoss, TrainError> {
        let measured = split_loss(model, self.inputs.tokens, self.inputs.text, split);
        let (step, steps, loss) = (self.standing.step, self.spec.steps, measured.loss_nats);
        if loss.is_finite() {
            Ok(measured)
        } else {
            Err(TrainError::NonFinite { step, steps, loss })
        }
    }

    fn wall_s(&self) -> f64 {
        self.standing.wall_s + self.started.elapsed().as_secs_f64()
    }

    fn save(&self, path: &Path) -> Result<(), WeightsError> {
        let standing = Standing { wall_s: self.wall_s(), ..self.standing.clone() };
        checkpoint::save(path, &self.model, &self.optimiser, &standing)
    }

    fn finish(self) -> Result<Trained, TrainError> {
        let model = self.model.frozen();
        Ok(Trained {
            test: self.measure(&model, Split::Test)?,
            model,
            flops_exact: TRAINING_PER_FORWARD * self.standing.forward_flops,
            wall_s: self.wall_s(),
            log: self.standing.log,
        })
    }
}

type State = (Model, AdamW, Standing);

/// A trunk's state, if it is of the step that is wanted.
fn branched(branch: &Branch, state: State) -> Result<State, TrainError> {
    let (found, wanted) = (state.2.step, branch.steps);
    if found == wanted {
        return Ok(state);
    }
    let path = branch.state.display().to_string();
    let reason = format!("it is of step {found}, not {wanted}; remove it to have it made again");
    Err(WeightsError::Read { path, reason }.into())
}

/// Multiply-adds of a batch, times two: each sequence at its own length, the head per target.
fn forward_flops(spec: &RunSpec, batch: &Batch) -> f64 {
    let layout = &batch.layout;
    let head = 2.0 * (spec.model.d_model * (spec.n_vocab + 1)) as f64;
    let blocks = (0..layout.n_sequences()).map(|i| {
        let prefix = layout.prefix(i) as f64;
        let targets = layout.len(i) as f64 - prefix + 1.0;
        exact_of_sequence(&spec.model, spec.n_vocab, prefix, targets) - targets * head
    });
    blocks.sum::<f64>() + batch.targets.len() as f64 * head
}

fn optimiser_config(spec: &RunSpec) -> AdamWConfig {
    AdamWConfig {
        beta_1: spec.betas[0],
        beta_2: spec.betas[1],
        epsilon: spec.epsilon,
        weight_decay: spec.weight_decay,
        clip_norm: spec.clip_norm,
    }
}
