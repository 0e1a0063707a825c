//! AdamW with a state that can be written down and taken up again on the same bits.

use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor, TensorData};

use crate::learn::weights::{HostTensor, Source, Sources, Weights};
use crate::ops::{self, AdamWStep};

/// The settings of AdamW.
#[derive(Clone, Debug, PartialEq)]
pub struct AdamWConfig {
    pub beta_1: f64,
    pub beta_2: f64,
    pub epsilon: f64,
    /// Decoupled: each step takes `lr · weight_decay` of a parameter away.
    pub weight_decay: f64,
    /// Gradients are scaled down to this global L2 norm where theirs is larger.
    pub clip_norm: Option<f64>,
}

const FIRST: &str = "moment_1.";
const SECOND: &str = "moment_2.";

/// AdamW (Loshchilov and Hutter 2019).
///
/// m ← β₁ m + (1 − β₁) g, v ← β₂ v + (1 − β₂) g², p ← p − lr · wd · p − lr · m̂ / (√v̂ + ε),
/// where m̂ = m / (1 − β₁ᵗ) and v̂ = v / (1 − β₂ᵗ). A parameter that a step has no gradient for is
/// left as it is, moments too.
pub struct AdamW {
    config: AdamWConfig,
    steps: i32,
    /// First and second moment, flat, by a parameter's place in the order of walking the module.
    moments: BTreeMap<usize, [Tensor<1>; 2]>,
}

impl AdamW {
    /// An optimiser that has seen no step.
    pub fn new(config: AdamWConfig) -> Self {
        Self { config, steps: 0, moments: BTreeMap::new() }
    }

    /// One step by gradients that are `scale` times too large; returns the module and the global norm
    /// of the gradients before clipping.
    pub fn step<M: Module>(
        &mut self,
        module: M,
        grads: GradientsParams,
        scale: f64,
        lr: f64,
    ) -> (M, f64) {
        self.steps += 1;
        let norm = global_norm(&module, &grads) / scale;
        let clip = match self.config.clip_norm {
            Some(limit) if norm > limit => limit / norm,
            _ => 1.0,
        } / scale;
        let mut update = Update { optimiser: self, grads, lr, clip, index: 0 };
        (module.map(&mut update), norm)
    }

    /// The state as named tensors, `moment_1.0`, `moment_2.0`, …, but for the number of steps.
    pub fn state(&self) -> Sources {
        let named = self.moments.iter().flat_map(|(i, [first, second])| {
            [(format!("{FIRST}{i}"), first), (format!("{SECOND}{i}"), second)]
        });
        named.map(|(name, tensor)| (name, Source::of(tensor.clone()))).collect()
    }

    /// Takes up the state that [`AdamW::state`] gave after so many steps; `None` if it is not such a state.
    pub fn with_state(mut self, steps: i32, state: Weights, device: &Device) -> Option<Self> {
        let tensor = |HostTensor { values, .. }| {
            let n = values.len();
            Tensor::from_data(TensorData::new(values, [n]), device)
        };
        let (firsts, mut seconds): (Weights, Weights) =
            state.into_iter().partition(|(name, _)| !name.starts_with(SECOND));
        for (name, first) in firsts {
            let index = name.strip_prefix(FIRST)?;
            let second = seconds.remove(&format!("{SECOND}{index}"))?;
            self.moments.insert(index.parse().ok()?, [tensor(first), tensor(second)]);
        }
        self.steps = steps;
        Some(self)
    }
}

fn global_norm<M: Module>(module: &M, grads: &GradientsParams) -> f64 {
    struct Norm<'a>(&'a GradientsParams, Vec<Tensor<1>>);
    impl burn::module::ModuleVisitor for Norm<'_> {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            if let Some(grad) = self.0.get::<D>(param.id) {
                let n = grad.shape().num_elements();
                self.1.push(grad.reshape([n]));
            }
        }
    }
    let mut norm = Norm(grads, Vec::new());
    module.visit(&mut norm);
    ops::sum_of_squares(norm.1).sqrt()
}

struct Update<'a> {
    optimiser: &'a mut AdamW,
    grads: GradientsParams,
    lr: f64,
    clip: f64,
    /// Parameters walked so far.
    index: usize,
}

impl Update<'_> {
    /// The parameter after the step; all tensors flat and of one length.
    fn apply(&mut self, value: Tensor<1>, grad: Tensor<1>) -> Tensor<1> {
        let AdamW { config, steps, moments } = &mut *self.optimiser;
        let step = config.numbers(*steps, self.lr, self.clip);
        let before = moments.remove(&self.index);
        let before = before.unwrap_or_else(|| [value.zeros_like(), value.zeros_like()]);
        let (value, after) = ops::adamw(value, grad, before, step);
        moments.insert(self.index, after);
        value
    }
}

impl AdamWConfig {
    /// The numbers of step `t`, from 1 on.
    fn numbers(&self, t: i32, lr: f64, clip: f64) -> AdamWStep {
        AdamWStep {
            beta_1: self.beta_1 as f32,
            beta_2: self.beta_2 as f32,
            epsilon: self.epsilon as f32,
            clip: clip as f32,
            keep: (1.0 - lr * self.weight_decay) as f32,
            rate: (lr / (1.0 - self.beta_1.powi(t))) as f32,
            scale: (1.0 - self.beta_2.powi(t)).sqrt().recip() as f32,
        }
    }
}

impl ModuleMapper for Update<'_> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (id, tensor, mapper) = param.consume();
        let tensor = match self.grads.remove::<D>(id) {
            None => tensor,
            Some(grad) => {
                let (shape, value) = (tensor.dims(), tensor.inner());
                let n = value.shape().num_elements();
                let value = self.apply(value.reshape([n]), grad.reshape([n]));
                value.reshape(shape).autodiff().require_grad()
            }
        };
        self.index += 1;
        Param::from_mapped_value(id, tensor, mapper)
    }
}
