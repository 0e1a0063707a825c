//! [`Learning`]: the one loop.

use std::path::Path;
use std::time::Instant;

use burn::optim::GradientsParams;

use super::adamw::AdamW;
use super::checkpoint::{self, Branch, Checkpoints, Header, Loaded};
use super::error::LearnError;
use super::learner::{Course, Learner};
use crate::files::FileError;
use crate::progress::{Progress, Step};

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

    /// The same from its checkpoint, or else from its trunk.
    fn resumed(self, checkpoints: &Checkpoints) -> Result<Self, FileError> {
        match (checkpoints.path, checkpoints.branch) {
            (own, _) if own.exists() => self.load(own),
            (_, Some(branch)) => self.load(branch.state)?.branched(&branch),
            (_, None) => Ok(self),
        }
    }

    fn load(mut self, path: &Path) -> Result<Self, FileError> {
        let module = self.learner.weights().clone();
        let Loaded { module, optimiser, saved, header } =
            checkpoint::load(path, module, self.optimiser)?;
        self.learner.set_weights(module);
        let taken_up = self.learner.resume(saved);
        taken_up.ok_or_else(|| FileError::damaged(path, "the learner's own state is missing"))?;
        let Header { step, wall_s: spent_s, .. } = header;
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

    /// Writes all that learning needs to go on from here.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let header = Header { step: self.step, wall_s: self.wall_s(), ..Default::default() };
        let (weights, kept) = (self.learner.weights(), self.learner.keep());
        checkpoint::save(path, weights, &self.optimiser, kept, header)
    }

    /// Seconds spent, those of earlier processes included.
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
