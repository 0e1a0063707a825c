//! MoMask's masked transformer: predicts hidden codes from the text and the visible codes; motions are made in a few
//! rounds, the surest codes first. Codes of several layers have a second transformer ([`residual`]).
//!
//! The network has the parameters of the autoregressive transformer, so the two differ only in their task. MoMask's own
//! has post-norm, biases and sinusoidal positions, and the sentence as one token in front.

mod hidden;
pub mod residual;

use std::f64::consts::FRAC_PI_2;

use super::autoregressive::{Batch, Model, TokenStream, end_token, probed_tokens};
use super::kind::step_rng;
use super::losses::SplitSums;
use super::probed::made_up_clip;
use super::sampling::{Making, check_length, guided, rows};
use super::{
    Draw, GeneratorError, Inputs, Kind, Objective, Prompt, Sampled, Sampler, Sampling, ScaleInputs,
    SplitLoss,
};
use crate::codes::Grid;
use crate::data::Split;
use crate::spec::RunSpec;
use hidden::{Shown, bound, forward_flops, hidden_clip, own};
use residual::{Asked, LayerBatch, ResidualModel};

pub use hidden::{Hidden, pack};

/// The masked transformer of one codebook as a kind of generator.
pub struct Masked;

impl Kind for Masked {
    type Network = Model;
    type Objective<'a> = HiddenCodes<'a>;

    fn sampler(spec: &RunSpec, model: Model) -> Box<dyn Sampler> {
        Box::new(MaskedSampler::new(spec, model, None))
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
        let stream = TokenStream::of_places(inputs.tokens, inputs.text, spec.seed);
        let stream = stream.over(spec.share).showing(spec.captions);
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

// Samples motions from the masked transformer: all codes at once, keeping the surest, round by round; then all codes
// of each further layer at once.

/// A trained transformer, or both stages.
pub struct MaskedSampler {
    model: Model,
    residual: Option<ResidualModel>,
    grid: Grid,
    text_drop: f64,
    /// The text of a caption that is left out.
    no_text: Vec<f32>,
}

impl MaskedSampler {
    /// The models of a run; there is a second where codes have several layers.
    pub fn new(spec: &RunSpec, model: Model, residual: Option<ResidualModel>) -> Self {
        let (text_drop, no_text) = (own(spec).text_drop, vec![0.0; spec.shape().d_text]);
        Self { model, residual, grid: spec.codes.clone(), text_drop, no_text }
    }

    fn begin<'a>(&self, prompt: &Prompt<'a>) -> Result<Making<'a>, GeneratorError> {
        let n_frames = prompt.n_frames.expect("the caller gives lengths where they are wanted");
        let n_text = prompt.text.len() / self.no_text.len();
        let places = |frames| self.grid.lengths(frames).next().unwrap_or(0);
        let n_places = places(n_frames);
        if n_places == 0 {
            let least = self.grid.frames_of(1).unwrap_or(0);
            return Err(GeneratorError::NoCode { n_frames, least });
        }
        check_length(n_frames, self.model.shape().n_ctx, |frames| places(frames) + n_text)?;
        let mut making = Making::new(prompt, self.grid.frames_of(n_places).unwrap_or(n_frames));
        let end = end_token(self.n_vocab());
        let kept = making.kept(0, n_places).into_iter();
        making.codes = kept.map(|code| code.unwrap_or(end)).collect();
        Ok(making)
    }

    /// Codes of the first layer.
    fn n_vocab(&self) -> usize {
        self.grid.scales[0].n_vocab
    }

    /// Logits of the hidden codes of all motions, a row each; with their texts, or all with one.
    fn logits(&self, making: &[Making], text: Option<&[f32]>) -> Vec<Vec<f32>> {
        let end = end_token(self.n_vocab());
        let hidden = making.iter().map(|motion| {
            let places = motion.codes.iter().enumerate().filter(|(_, code)| **code == end);
            let targets = places.map(|(place, _)| (place, 0)).collect();
            let text = text.unwrap_or(motion.text);
            Hidden { text, shown: motion.codes.clone(), targets }
        });
        let clips: Vec<Hidden> = hidden.collect();
        rows(self.model.logits(&pack(&clips, self.no_text.len())))
    }

    /// One round: every hidden code is drawn, and the least sure of them are hidden again for the next
    /// round, which begins with the share `next` of a motion hidden.
    fn round(&self, making: &mut [Making], next: Option<f64>, sampling: &Sampling) {
        let n_vocab = self.n_vocab();
        let pass = |text| self.logits(making, text);
        let mut rows = guided(pass, &self.no_text, sampling.guidance).into_iter();
        for motion in making {
            let kept = motion.kept(0, motion.codes.len());
            let n_drawn = kept.iter().filter(|code| code.is_none()).count() as f64;
            let n_hidden = next.map_or(0, |share| (share * n_drawn).round().max(1.0) as usize);
            let hidden = motion.codes.iter().enumerate();
            let hidden = hidden.filter(|(_, code)| **code == end_token(n_vocab));
            let draw = |(place, _): (usize, &u32)| {
                let row = &rows.next().expect("a row a hidden code")[..n_vocab];
                let code = sampling.draw.any_code(row, &mut motion.rng);
                (place, code, Draw::confidence(row, code as usize))
            };
            let mut drawn: Vec<(usize, u32, f64)> = hidden.map(draw).collect();
            drawn.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.cmp(&b.0)));
            let stay = drawn.len().saturating_sub(n_hidden);
            for (place, code, _) in drawn.into_iter().take(stay) {
                motion.codes[place] = code;
            }
        }
    }

    /// Adds the codes of further layers to motions with codes of the first, layer by layer.
    fn draw_layers(&self, model: &ResidualModel, making: &mut [Making], sampling: &Sampling) {
        for layer in 1..self.grid.scales.len() {
            let pass = |text| self.layer_logits(model, making, layer, text);
            let mut rows = guided(pass, &self.no_text, sampling.guidance).into_iter();
            for motion in &mut *making {
                for kept in motion.kept(motion.codes.len(), motion.codes.len() / layer) {
                    let row = rows.next().expect("a row a place");
                    let drawn = || sampling.draw.any_code(&row, &mut motion.rng);
                    motion.codes.push(kept.unwrap_or_else(drawn));
                }
            }
        }
    }

    /// Logits of the codes of a layer, a row a place of all motions; with their texts, or all with one.
    fn layer_logits(
        &self,
        model: &ResidualModel,
        making: &[Making],
        layer: usize,
        text: Option<&[f32]>,
    ) -> Vec<Vec<f32>> {
        let n_places = |motion: &Making| motion.codes.len() / layer;
        let unknown = vec![0; making.iter().map(n_places).max().unwrap_or(0)];
        let asked = making.iter().map(|motion| Asked {
            text: text.unwrap_or(motion.text),
            below: &motion.codes,
            layer,
            places: 0..n_places(motion),
            targets: &unknown[..n_places(motion)],
        });
        let asked: Vec<Asked> = asked.collect();
        rows(model.logits(&LayerBatch::pack(&asked, &self.grid, self.no_text.len()), layer))
    }
}

impl Sampler for MaskedSampler {
    /// Rounds as MoMask's: round i of n begins with the share cos(π/2 · i / (n − 1)) of a motion hidden,
    /// i from 0, and one code at least; a code that was shown once stays.
    fn sample(
        &self,
        prompts: &[Prompt],
        _: &dyn ScaleInputs,
        sampling: &Sampling,
    ) -> Result<Vec<Sampled>, GeneratorError> {
        sampling.check_guidance(self.text_drop)?;
        let making = prompts.iter().map(|prompt| self.begin(prompt));
        let mut making = making.collect::<Result<Vec<_>, _>>()?;
        let last = sampling.rounds.max(1) - 1;
        for round in 0..=last {
            let next = (round + 1) as f64 / last as f64;
            let next = (round < last).then(|| (FRAC_PI_2 * next).cos());
            self.round(&mut making, next, sampling);
        }
        if let Some(residual) = &self.residual {
            self.draw_layers(residual, &mut making, sampling);
        }
        Ok(making.into_iter().map(Making::done).collect())
    }
}
