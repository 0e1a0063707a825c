//! The weights kept from a training: their [`Average`], and the best on the validation split by [`Watch`].

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};

use super::TokenizerError;
use super::codec::Tokenizer;
use super::corpus::Corpus;
use super::evaluate::{empty_split, reconstruct};
use super::module::TokenizerModule;
use crate::data::Split;
use crate::learn::is_due;
use crate::learn::weights::{self, Sources, Weights};
use crate::spec::{Plateau, TokenizerSpec};

/// The moving average of the weights: p̄ ← d p̄ + (1 − d) p with d = min(decay, t / (t + 9)) after step
/// t. What no gradient moves, as a codebook, is taken as it is.
pub struct Average {
    /// The averaged weights.
    pub module: TokenizerModule,
    decay: f64,
}

impl Average {
    /// That of weights before the first step.
    pub fn new(module: &TokenizerModule, decay: f64) -> Self {
        Self { module: module.valid(), decay }
    }

    /// Takes in the weights after a step, counted from 1.
    pub fn follow(&mut self, module: &TokenizerModule, step: usize) {
        let decay = self.decay.min(step as f64 / (step + 9) as f64);
        let mut now = Collected(Vec::new());
        module.visit(&mut now);
        now.0.reverse();
        let average = std::mem::replace(&mut self.module, module.valid());
        self.module = average.map(&mut Follow { now: now.0, decay });
    }

    /// The weights, to be written.
    pub fn keep(&self) -> Sources {
        weights::of_module(&self.module)
    }

    /// Takes up what [`Average::keep`] gave; `None` if it is not that.
    pub fn resume(&mut self, saved: Weights) -> Option<()> {
        self.module = weights::into_module(self.module.clone(), saved).ok()?;
        Some(())
    }
}

/// Every parameter of a module, flat, and whether gradients move it.
struct Collected(Vec<(Tensor<1>, bool)>);

impl ModuleVisitor for Collected {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let tensor = param.val();
        let n = tensor.shape().num_elements();
        self.0.push((tensor.inner().reshape([n]), param.is_require_grad()));
    }
}

struct Follow {
    /// In the order of walking the module, the next one last.
    now: Vec<(Tensor<1>, bool)>,
    decay: f64,
}

impl ModuleMapper for Follow {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (now, learns) = self.now.pop().expect("both are of one structure");
        let (id, average, mapper) = param.consume();
        let now = now.reshape(average.shape());
        let next = match learns {
            true => average * self.decay + now * (1.0 - self.decay),
            false => now,
        };
        Param::from_mapped_value(id, next, mapper)
    }
}

/// A line of a tokenizer's `log.jsonl`: the validation split after a step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Validated {
    /// Counted from 1.
    pub step: usize,
    /// Mean per-joint position error, pelvis-aligned, in millimetres.
    pub val_mpjpe_mm: f64,
}

/// The first of the best lines; `None` before any.
pub fn best(log: &[Validated]) -> Option<&Validated> {
    log.iter().min_by(|a, b| a.val_mpjpe_mm.total_cmp(&b.val_mpjpe_mm))
}

/// Measures the validation split now and then, and keeps the best weights.
pub struct Watch<'a> {
    corpus: Corpus<'a>,
    plateau: Plateau,
    spec: &'a TokenizerSpec,
    device: Device,
    log: Vec<Validated>,
    /// The weights of the best line.
    best: TokenizerModule,
    /// Why the split could not be measured.
    failed: Option<TokenizerError>,
}

impl<'a> Watch<'a> {
    /// Before the first step of `module`, on `device` without gradients.
    ///
    /// # Errors
    /// There is no validation split.
    pub fn new(
        plateau: Plateau,
        (spec, corpus): (&'a TokenizerSpec, Corpus<'a>),
        module: &TokenizerModule,
        device: Device,
    ) -> Result<Self, TokenizerError> {
        if corpus.source.n_clips(Split::Val) == 0 {
            return Err(empty_split(&corpus, Split::Val));
        }
        let (log, failed, best) = (Vec::new(), None, module.clone());
        Ok(Self { corpus, plateau, spec, device, log, best, failed })
    }

    /// Is shown the weights that would be kept after a step, counted from 1.
    pub fn see(&mut self, module: &TokenizerModule, step: usize) {
        if !is_due(step, self.spec.training.steps, self.plateau.evaluations) {
            return;
        }
        let tokenizer =
            Tokenizer::of_clips(module.clone(), self.spec, self.corpus.source, &self.device);
        match reconstruct(&tokenizer, &self.corpus, Split::Val, 0.0) {
            Err(error) => self.failed = Some(error),
            Ok(made) => {
                self.log.push(Validated { step, val_mpjpe_mm: made.mpjpe_mm });
                if best(&self.log) == self.log.last() {
                    self.best = module.clone();
                }
            }
        }
    }

    /// Whether training is over: nothing new for long, or a split that cannot be measured.
    pub fn is_over(&self) -> bool {
        let since = |best: &Validated| self.log.iter().filter(|line| line.step > best.step).count();
        self.failed.is_some() || best(&self.log).map_or(0, since) >= self.plateau.patience
    }

    /// The best weights, and every line.
    ///
    /// # Errors
    /// The split could not be measured.
    pub fn end(self) -> Result<(TokenizerModule, Vec<Validated>), TokenizerError> {
        self.failed.map_or(Ok((self.best, self.log)), Err)
    }

    /// Its lines and weights, to be written.
    pub fn keep(&self) -> (serde_json::Value, Sources) {
        (serde_json::to_value(&self.log).expect("plain values"), weights::of_module(&self.best))
    }

    /// Takes up what [`Watch::keep`] gave; `None` if it is not that.
    pub fn resume(&mut self, log: serde_json::Value, best: Weights) -> Option<()> {
        self.log = serde_json::from_value(log).ok()?;
        self.best = weights::into_module(self.best.clone(), best).ok()?;
        Some(())
    }
}
