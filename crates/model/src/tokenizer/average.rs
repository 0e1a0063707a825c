//! [`Average`]: the moving average of a tokenizer's weights.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::Tensor;

use super::module::TokenizerModule;
use crate::learn::weights::{self, Sources, Weights};

/// The moving average of the weights: p̄ ← d p̄ + (1 − d) p with d = min(decay, t / (t + 9)) after step
/// t. What no gradient moves, as a codebook, is taken as it is.
pub struct Average {
    module: TokenizerModule,
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

    /// The averaged weights.
    pub fn module(&self) -> &TokenizerModule {
        &self.module
    }

    /// The weights, to be written.
    pub fn keep(&self) -> Sources {
        weights::of_module(&self.module)
    }

    /// Takes up what [`Average::keep`] gave; `None` where it is not that.
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
