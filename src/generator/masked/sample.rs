//! Motions from the masked transformer: all codes at once, of which the surest stay, round after round;
//! then, where there are further layers, those of a layer all at once.

use std::f64::consts::FRAC_PI_2;
use std::slice;

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Hidden, pack};
use super::making::{Making, guided};
use super::own::own;
use super::residual::{ResidualModel, Stages, draw_layers};
use crate::codes::Grid;
use crate::generator::autoregressive::{Model, end_token};
use crate::generator::{Draw, GeneratorError, Prompt, Sampled, Sampler, Sampling, ScaleInputs};
use crate::learn::weights::{self, Weights};
use crate::plan::RunSpec;
use crate::spec::Precision;

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
    /// The transformer of a run with its weights.
    ///
    /// # Errors
    /// [`GeneratorError::Weights`].
    pub fn new(spec: &RunSpec, weights: Weights, device: &Device) -> Result<Self, GeneratorError> {
        let (model, residual) = models(spec, weights, device)?;
        let (text_drop, no_text) = (own(spec).text_drop, vec![0.0; spec.shape().d_text]);
        Ok(Self { model, residual, grid: spec.codes.clone(), text_drop, no_text })
    }

    fn begin<'a>(
        &self,
        prompt: &Prompt<'a>,
        sampling: &Sampling,
    ) -> Result<Making<'a>, GeneratorError> {
        if sampling.guidance > 0.0 && self.text_drop == 0.0 {
            return Err(GeneratorError::Guidance);
        }
        let asked = prompt.n_frames.expect("the caller gives lengths where they are wanted");
        let n_places = self.n_places(asked, prompt.text.len() / self.no_text.len())?;
        let n_frames = self.grid.frames_of(n_places).unwrap_or(asked);
        let codes = vec![end_token(self.n_vocab()); n_places];
        Ok(Making { text: prompt.text, rng: prompt.rng(), codes, n_places, n_frames })
    }

    /// Places of a motion of so many frames after so many text positions.
    fn n_places(&self, n_frames: usize, n_text: usize) -> Result<usize, GeneratorError> {
        let of = |frames| self.grid.lengths(frames).next().unwrap_or(0);
        let (n_places, n_ctx) = (of(n_frames), self.model.shape().n_ctx);
        let positions = n_places + n_text;
        if n_places == 0 {
            let least = self.grid.frames_of(1).unwrap_or(0);
            return Err(GeneratorError::NoCode { n_frames, least });
        }
        if positions > n_ctx {
            let fits = |frames: &usize| of(*frames) + n_text <= n_ctx;
            let most = (0..n_frames).rev().find(fits).unwrap_or(0);
            return Err(GeneratorError::Length { n_frames, positions, n_ctx, most });
        }
        Ok(n_places)
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
        let logits = self.model.logits(&pack(&clips, self.no_text.len()));
        let [_, columns] = logits.dims();
        let values: Vec<f32> = logits.into_data().try_into_vec().expect("logits are f32");
        values.chunks_exact(columns).map(<[f32]>::to_vec).collect()
    }

    /// One round: every hidden code is drawn, and all but `n_hidden` of a motion, the surest, stay.
    fn round(&self, making: &mut [Making], share: f64, sampling: &Sampling) {
        let n_vocab = self.n_vocab();
        let pass = |text| self.logits(making, text);
        let mut rows = guided(pass, &self.no_text, sampling.guidance).into_iter();
        for motion in making {
            let n_hidden = (share * motion.codes.len() as f64).round() as usize;
            let places: Vec<usize> = (0..motion.codes.len())
                .filter(|&place| motion.codes[place] == end_token(n_vocab))
                .collect();
            let mut drawn: Vec<(usize, u32, f64)> = Vec::with_capacity(places.len());
            for place in places {
                let row = rows.next().expect("a row a hidden code");
                let code =
                    sampling.draw.code(&row, slice::from_ref(&(0..n_vocab)), &mut motion.rng);
                drawn.push((place, code as u32, Draw::confidence(&row[..n_vocab], code)));
            }
            drawn.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.cmp(&b.0)));
            // A round that hides as many as the last would never end.
            let stay = drawn.len().saturating_sub(n_hidden).max(1);
            for (place, code, _) in drawn.into_iter().take(stay) {
                motion.codes[place] = code;
            }
        }
    }
}

/// The stages of a run with its weights; there is a second where codes have several layers.
fn models(
    spec: &RunSpec,
    weights: Weights,
    device: &Device,
) -> Result<(Model, Option<ResidualModel>), GeneratorError> {
    let mut unused = ChaCha8Rng::seed_from_u64(0);
    if spec.codes.scales.len() == 1 {
        let mut model = Model::init(spec.shape(), spec.n_vocab(), &mut unused, device);
        model.weights = weights::into_module(model.weights, weights)?;
        return Ok((model, None));
    }
    let mut stages = Stages::init(spec.shape(), &spec.codes, Precision::F32, &mut unused, device);
    stages.set_weights(weights::into_module(stages.weights().clone(), weights)?);
    Ok((stages.base, Some(stages.residual)))
}

impl Sampler for MaskedSampler {
    fn wants_length(&self) -> bool {
        true
    }

    /// Rounds as MoMask's: after round i of n the share cos(π i / 2n) of a motion is hidden again.
    fn sample(
        &self,
        prompts: &[Prompt],
        _: &dyn ScaleInputs,
        sampling: &Sampling,
    ) -> Result<Vec<Sampled>, GeneratorError> {
        let making = prompts.iter().map(|prompt| self.begin(prompt, sampling));
        let mut making = making.collect::<Result<Vec<_>, _>>()?;
        let rounds = sampling.rounds.max(1);
        for round in 1..=rounds {
            let share = if round == rounds {
                0.0
            } else {
                (FRAC_PI_2 * round as f64 / rounds as f64).cos()
            };
            self.round(&mut making, share, sampling);
        }
        if let Some(residual) = &self.residual {
            draw_layers(residual, &self.grid, &mut making, &self.no_text, sampling);
        }
        let done =
            |Making { codes, n_frames, .. }: Making| Sampled { codes, n_frames, ended: true };
        Ok(making.into_iter().map(done).collect())
    }
}
