//! [`HiddenCodes`]: the batches of a run of the masked transformer of one codebook.

use super::batch::{Hidden, pack};
use super::evaluate::bound;
use super::flops::forward_flops;
use super::shown::Shown;
use crate::data::Split;
use crate::generator::autoregressive::{Batch, Model, TokenStream};
use crate::generator::learner::step_rng;
use crate::generator::sums::SplitSums;
use crate::generator::{Inputs, Objective, SplitLoss};
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
}

impl<'a> Objective<'a> for HiddenCodes<'a> {
    type Network = Model;

    fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self {
        let stream = TokenStream::of_places(inputs.tokens, inputs.text, spec.seed).over(spec.share);
        Self { spec, inputs, stream, shown: Shown::new(spec, inputs) }
    }

    fn batch(&mut self, _: &Model, step: usize) -> (Batch, f64) {
        let n = self.spec.batch_tokens;
        let parts = self.stream.parts(step * n, n);
        let mut rng = step_rng(self.spec, step);
        let clips: Vec<Hidden> =
            parts.iter().map(|part| self.shown.hidden(part, &mut rng)).collect();
        let batch = pack(&clips, self.inputs.text.dim());
        let forward_flops = forward_flops(self.spec.shape(), self.spec.n_vocab(), &clips, &batch);
        (batch, forward_flops)
    }

    fn split_loss(&self, model: &Model, split: Split) -> SplitLoss {
        let mut sums = SplitSums::by_scale(self.inputs.tokens, split);
        bound(&model.frozen(), self.inputs, &mut sums);
        sums.loss()
    }

    fn uniform_nats(&self) -> f64 {
        ((self.spec.n_vocab() + 1) as f64).ln()
    }
}
