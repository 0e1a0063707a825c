//! Motions from the masked transformer: all codes at once, of which the surest stay, round after round;
//! then, where there are further layers, those of a layer all at once.

use std::f64::consts::FRAC_PI_2;

use super::batch::{Hidden, pack};
use super::residual::{ResidualModel, draw_layers};
use super::shown::own;
use crate::codes::Grid;
use crate::generator::autoregressive::{Model, end_token};
use crate::generator::sampling::{Making, check_length, guided, rows};
use crate::generator::{Draw, GeneratorError, Prompt, Sampled, Sampler, Sampling, ScaleInputs};
use crate::plan::RunSpec;

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
            draw_layers(residual, &self.grid, &mut making, &self.no_text, sampling);
        }
        Ok(making.into_iter().map(Making::done).collect())
    }
}
