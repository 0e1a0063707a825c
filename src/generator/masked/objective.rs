//! [`HiddenCodes`]: the masked transformer of one codebook on the batches of a run.

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Hidden, pack};
use super::evaluate::split_loss;
use super::flops::forward_flops;
use super::shown::Shown;
use crate::data::Split;
use crate::generator::autoregressive::{Model, TokenStream, Transformer, first_model};
use crate::generator::learner::{BatchLoss, FIRST_STEP_STREAM, Objective};
use crate::generator::{Inputs, SplitLoss};
use crate::plan::RunSpec;

/// The cross-entropy of hidden codes.
///
/// As MoMask trains: of a clip the share cos(π u / 2) is hidden, u drawn from 0 to 1, and one code at
/// least; a share of the captions is left out, as one vector of zeros. MoMask shows a tenth of the
/// hidden codes as random ones and a tenth as they are; here the first is `model.corruption` and the
/// second is left out.
pub struct HiddenCodes<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
    shown: Shown<'a>,
    model: Model,
}

impl<'a> HiddenCodes<'a> {
    /// A model with the weights of a seed, on `device` in the run's precision.
    pub fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>, device: &Device) -> Self {
        let model = first_model(spec, &device.clone().autodiff());
        let stream = TokenStream::of_places(inputs.tokens, inputs.text, spec.seed).over(spec.share);
        let shown = Shown::new(spec, inputs);
        Self { spec, inputs, stream, shown, model: model.in_precision(spec.precision) }
    }
}

impl Objective for HiddenCodes<'_> {
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

    fn loss(&mut self, step: usize) -> BatchLoss {
        let n = self.spec.batch_tokens;
        let parts = self.stream.parts(step * n, n);
        let mut rng = ChaCha8Rng::seed_from_u64(self.spec.seed);
        rng.set_stream(FIRST_STEP_STREAM + step as u64);
        let clips: Vec<Hidden> =
            parts.iter().map(|part| self.shown.hidden(part, &mut rng)).collect();
        let batch = pack(&clips, self.inputs.text.dim());
        let forward_flops = forward_flops(self.spec.shape(), self.spec.n_vocab(), &clips, &batch);
        BatchLoss { loss: self.model.loss(&batch), forward_flops }
    }

    fn split_loss(&self, split: Split) -> SplitLoss {
        split_loss(&self.model.frozen(), self.inputs, split)
    }

    fn uniform_nats(&self) -> f64 {
        ((self.spec.n_vocab() + 1) as f64).ln()
    }
}
