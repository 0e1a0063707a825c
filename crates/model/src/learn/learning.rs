//! [`Learning`]: the one loop, and its checkpoints: all that learning needs to go on with the same bits, in
//! one file.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::time::{Duration, Instant};

use burn::module::Module;
use burn::optim::GradientsParams;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::adamw::AdamW;
use super::weights::{self, Sources, Weights};
use super::{Course, LearnError, Learner, LearnerState, LoadedState};
use crate::files::FileError;
use crate::progress::{Progress, Step};

/// The paths of a learner's state.
#[derive(Clone, Copy, Debug)]
pub struct Checkpoints<'a> {
    /// Written periodically; if it exists, learning resumes from it. The caller removes it after the result is
    /// complete.
    pub path: &'a Path,
    /// Never changes the result.
    pub every: Duration,
    /// The start without a checkpoint.
    pub branch: Option<Branch<'a>>,
}

/// The end of a trunk, from which runs go on.
#[derive(Clone, Copy, Debug)]
pub struct Branch<'a> {
    pub state: &'a Path,
    /// The steps that are done there.
    pub steps: usize,
}

/// A learner on its course: after how many steps, with which moments.
pub struct Learning<L> {
    learner: L,
    optimiser: AdamW,
    steps: usize,
    /// Steps done.
    step: usize,
    /// Seconds spent before this process.
    spent_s: f64,
    started: Instant,
}

impl<L: Learner> Learning<L> {
    /// A learner before its first step.
    pub fn new(learner: L, course: &Course) -> Self {
        let optimiser = AdamW::new(course.optimiser.clone());
        let started = Instant::now();
        Self { learner, optimiser, steps: course.steps, step: 0, spent_s: 0.0, started }
    }

    /// A learner at the end of its course, which begins at its checkpoint, else at the trunk that it
    /// branches off, else before the first step.
    ///
    /// # Errors
    /// Learning diverged or was stopped; a checkpoint could not be written; the checkpoint or the trunk
    /// cannot be read or is damaged: neither is ever skipped silently.
    pub fn run(
        learner: L,
        course: &Course,
        checkpoints: Option<&Checkpoints>,
        progress: &mut Progress,
    ) -> Result<Self, LearnError> {
        let mut learning = Self::new(learner, course);
        if let Some(checkpoints) = checkpoints {
            learning = learning.resumed(checkpoints)?;
        }
        learning.go_on(checkpoints, progress)?;
        Ok(learning)
    }

    /// The same from its checkpoint, else from its trunk.
    fn resumed(self, checkpoints: &Checkpoints) -> Result<Self, FileError> {
        match (checkpoints.path, checkpoints.branch) {
            (own, _) if own.exists() => self.load(own),
            (_, Some(branch)) => self.load(branch.state)?.branched(&branch),
            (_, None) => Ok(self),
        }
    }

    /// Loads a checkpoint.
    ///
    /// # Errors
    /// [`FileError::Read`]; [`FileError::Damaged`] also if it belongs to another learner.
    fn load(mut self, path: &Path) -> Result<Self, FileError> {
        let damaged = |reason: &str| FileError::damaged(path, reason);
        let (mut tensors, notes) = weights::load(path)?;
        let header = notes.get(HEADER).ok_or_else(|| damaged("no header in it"))?;
        let header = serde_json::from_str(header).map_err(|error| damaged(&error.to_string()))?;
        let Header { step, wall_s: spent_s, learner: note } = header;
        let (parameters, own) = (take(&mut tensors, WEIGHTS), take(&mut tensors, LEARNER));
        let module = weights::into_module(self.learner.weights().clone(), parameters)
            .map_err(|error| damaged(&error.to_string()))?;
        let steps = i32::try_from(step).map_err(|_| damaged("an impossible step"))?;
        let device = module.devices().swap_remove(0).inner();
        let optimiser = self.optimiser.with_state(steps, tensors, &device);
        let optimiser = optimiser.ok_or_else(|| damaged("moments are missing"))?;
        self.learner.set_weights(module);
        let taken_up = self.learner.resume(LoadedState { note, tensors: own });
        taken_up.ok_or_else(|| damaged("the learner's own state is missing"))?;
        tracing::info!(path = %path.display(), step, "resumed");
        Ok(Self { optimiser, step, spent_s, ..self })
    }

    /// A trunk's state, if it is of the step that is wanted.
    fn branched(self, branch: &Branch) -> Result<Self, FileError> {
        let (found, wanted) = (self.step, branch.steps);
        if found == wanted {
            return Ok(self);
        }
        let reason = format!("it is of step {found}, not {wanted}");
        Err(FileError::damaged(branch.state, reason))
    }

    /// Takes the steps that are left, or as many as the learner wants, and writes a checkpoint now and then.
    fn go_on(
        &mut self,
        checkpoints: Option<&Checkpoints>,
        progress: &mut Progress,
    ) -> Result<(), LearnError> {
        let (mut saved, steps) = (Instant::now(), self.steps);
        let before = checkpoints.and_then(|c| c.branch).map_or(0, |branch| branch.steps);
        while self.step < steps && !self.learner.is_over() {
            let began = Instant::now();
            let loss = self.step()?;
            let seconds = began.elapsed().as_secs_f64();
            self.learner.after(self.step, loss)?;
            let step = self.step;
            let done = Step { step: step - before, steps: steps - before, loss, seconds };
            let is_last = step == steps || self.learner.is_over();
            let stopped = progress(done).is_break() && !is_last;
            if let Some(checkpoints) = checkpoints
                && (stopped || saved.elapsed() >= checkpoints.every)
            {
                self.save(checkpoints.path)?;
                saved = Instant::now();
            }
            if stopped {
                return Err(LearnError::Stopped { step, steps });
            }
        }
        Ok(())
    }

    /// One step; its loss before the update.
    ///
    /// # Errors
    /// [`LearnError::NonFinite`] and [`LearnError::Diverged`].
    pub fn step(&mut self) -> Result<f64, LearnError> {
        let loss = self.learner.loss(self.step);
        let scale = self.learner.loss_scale();
        let scaled = if scale == 1.0 { loss.clone() } else { loss.clone() * scale };
        let weights = self.learner.weights();
        let gradients = GradientsParams::from_grads(scaled.backward(), weights);
        // Read once all of the step is on its way, since a GPU is waited for here.
        let value = f64::from(loss.into_scalar::<f32>());
        self.check(value)?;
        let (weights, rate) = (weights.clone(), self.learner.learning_rate(self.step));
        let (weights, _) = self.optimiser.step(weights, gradients, scale, rate);
        self.learner.set_weights(weights);
        self.step += 1;
        Ok(value)
    }

    fn check(&self, loss: f64) -> Result<(), LearnError> {
        let (step, steps, advice) = (self.step + 1, self.steps, self.learner.advice());
        if !loss.is_finite() {
            return Err(LearnError::NonFinite { step, steps, loss, advice });
        }
        match self.learner.ignorant() {
            Some((ignorant, margin)) if loss > ignorant + margin => {
                Err(LearnError::Diverged { step, steps, loss, ignorant, advice })
            }
            _ => Ok(()),
        }
    }

    /// Writes the full state of learning atomically, replacing an older one.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let LearnerState { note, tensors: own } = self.learner.keep();
        let mut tensors = self.optimiser.state();
        tensors.extend(prefixed(WEIGHTS, weights::of_module(self.learner.weights())));
        tensors.extend(prefixed(LEARNER, own));
        let header = Header { step: self.step, wall_s: self.wall_s(), learner: note };
        let header = serde_json::to_string(&header).expect("plain values");
        weights::save(path, &tensors, BTreeMap::from([(HEADER.to_string(), header)]))
    }

    /// Seconds spent, including earlier processes.
    pub fn wall_s(&self) -> f64 {
        self.spent_s + self.started.elapsed().as_secs_f64()
    }

    /// The learner as it is.
    pub fn learner(&self) -> &L {
        &self.learner
    }

    /// The learner, after its course.
    pub fn into_learner(self) -> L {
        self.learner
    }
}

// A checkpoint as a file.

/// The part without tensors.
#[derive(Serialize, Deserialize)]
struct Header {
    /// Steps done.
    step: usize,
    /// Seconds spent before this process.
    wall_s: f64,
    /// The learner's own note.
    #[serde(default)]
    learner: Value,
}

const HEADER: &str = "header";
const WEIGHTS: &str = "weights.";
const LEARNER: &str = "learner.";

fn prefixed(prefix: &str, sources: Sources) -> impl Iterator<Item = (String, weights::Source)> {
    sources.into_iter().map(move |(name, tensor)| (format!("{prefix}{name}"), tensor))
}

/// The tensors whose names begin with a prefix, without it.
fn take(tensors: &mut Weights, prefix: &str) -> Weights {
    let all = std::mem::take(tensors);
    let (wanted, others): (Weights, Weights) =
        all.into_iter().partition(|(name, _)| name.starts_with(prefix));
    *tensors = others;
    wanted.into_iter().map(|(name, tensor)| (name[prefix.len()..].to_string(), tensor)).collect()
}

/// The step of a checkpoint, from the head of its file; `None` if unknown.
pub fn step_of(path: &Path) -> Option<usize> {
    let mut file = File::open(path).ok()?;
    let mut length = [0; 8];
    file.read_exact(&mut length).ok()?;
    let mut head = Vec::new();
    file.take(u64::from_le_bytes(length)).read_to_end(&mut head).ok()?;
    let head: Value = serde_json::from_slice(&head).ok()?;
    let notes = weights::verified(head["__metadata__"][weights::NOTES].as_str()?)?;
    let header: Header = serde_json::from_str(notes.get(HEADER)?).ok()?;
    Some(header.step)
}
