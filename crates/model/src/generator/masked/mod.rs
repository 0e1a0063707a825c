//! MoMask's masked transformer: hidden codes are predicted from the text and the codes that are not
//! hidden; motions are made in a few rounds, the surest codes first. Codes of several layers have a
//! second transformer ([`residual`]).
//!
//! The network is the autoregressive transformer's, parameter for parameter, so that the two differ in
//! what they are asked alone. MoMask's own has post-norm, biases and sinusoidal positions, and the
//! sentence as one token in front.

mod batch;
pub mod residual;

pub use batch::{Hidden, pack};

use super::autoregressive::{Batch, Model, TokenStream, probed_tokens};
use super::probed::made_up_clip;
use super::{Inputs, Kind, Objective, Sampler, SplitLoss};
use crate::spec::RunSpec;
use batch::{Shown, bound, forward_flops, hidden_clip};

use super::kind::step_rng;
use super::trained::SplitSums;
use crate::data::Split;

/// The masked transformer of one codebook as a kind of generator.
pub struct Masked;

impl Kind for Masked {
    type Network = Model;
    type Objective<'a> = HiddenCodes<'a>;

    fn sampler(spec: &RunSpec, model: Model) -> Box<dyn Sampler> {
        Box::new(batch::MaskedSampler::new(spec, model, None))
    }

    fn made_up(spec: &RunSpec, model: &Model) -> (Batch, usize) {
        let (text, codes) = made_up_clip(model.shape(), spec.n_vocab());
        let n_clips = probed_tokens(spec).div_ceil(codes.len());
        let clips = vec![hidden_clip(&text, &codes, spec.n_vocab()); n_clips];
        (pack(&clips, model.shape().d_text), n_clips * codes.len())
    }
}

// [`HiddenCodes`]: the batches of a run of the masked transformer of one codebook.

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
