//! Motions from the scale-by-scale transformer: a scale at a time, its codes all at once.
//!
//! Shapes: b clips of one length, n codes of a scale.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::model::Model;
use crate::codes::Grid;
use crate::generator::sampling::{Making, guide, rows};
use crate::generator::stack::{Growing, padded};
use crate::generator::{GeneratorError, Prompt, Sampled, Sampler, Sampling, ScaleInputs};
use crate::plan::RunSpec;

/// A trained transformer.
pub struct ScalewiseSampler {
    model: Model,
    grid: Grid,
    /// The text of a caption that is left out.
    no_text: Vec<f32>,
}

impl ScalewiseSampler {
    /// The transformer of a run.
    pub fn new(spec: &RunSpec, model: Model) -> Self {
        Self { model, grid: spec.codes.clone(), no_text: vec![0.0; spec.shape().d_text] }
    }

    /// A motion without a code, of whole latents.
    fn begin<'a>(&self, prompt: &Prompt<'a>) -> Result<Making<'a>, GeneratorError> {
        let spec = self.model.spec();
        let n_frames = prompt.n_frames.expect("the caller gives lengths where they are wanted");
        let whole = n_frames - n_frames % spec.frames_per_latent;
        let most = spec.most_latents * spec.frames_per_latent;
        if whole <= most {
            return Ok(Making::new(prompt, whole));
        }
        let text = prompt.text.len() / spec.shape.d_text;
        let positions = text + self.grid.n_codes(n_frames);
        Err(GeneratorError::Length { n_frames, positions, n_ctx: spec.shape.n_ctx, most })
    }

    /// The codes of motions of one length. With each motion that is guided goes one without text, after
    /// all of them.
    fn make(&self, motions: &mut [&mut Making], scales: &dyn ScaleInputs, sampling: &Sampling) {
        let (n_frames, each) = (motions[0].n_frames, if sampling.guidance > 0.0 { 2 } else { 1 });
        let n_sequences = each * motions.len();
        let mut texts: Vec<&[f32]> = motions.iter().map(|motion| motion.text).collect();
        texts.resize(n_sequences, &self.no_text);
        let n_latents = scales.n_latents(n_frames) as u32;
        let mut growing = self.with_text(&texts, n_latents);
        let lengths: Vec<usize> = self.grid.lengths(n_frames).collect();
        let last = lengths.len().saturating_sub(1).max(1) as f64;
        for (scale, &n) in lengths.iter().enumerate() {
            let slots = n_sequences * n;
            let x_nd = if scale == 0 {
                let places = (0..slots).map(|row| (row % n) as u32).collect();
                self.model.start_rows(&places, &vec![n_latents; slots].into())
            } else {
                let codes = motions.iter().flat_map(|motion| &motion.codes).copied();
                let codes: Vec<u32> = codes.collect();
                let inputs = scales.inputs(&codes, motions.len(), n_frames).swap_remove(scale - 1);
                self.model.input_rows(inputs.repeat(each), &vec![scale as u32; slots].into())
            };
            let angles = (0..n_sequences).flat_map(|_| self.model.places().scale(scale, n));
            let angles: Vec<usize> = angles.collect();
            let kept = motions.iter().flat_map(|motion| motion.kept(motion.codes.len(), n));
            let kept: Vec<Option<u32>> = kept.collect();
            // What stays reads no text, which is about what is made anew (LG-Tok, eq. 7).
            let blind: Vec<bool> = kept.iter().map(Option::is_some).collect();
            let x_nd = growing.join(x_nd, &angles, &blind.repeat(each));
            let mut logits = rows(self.model.logits(scale, x_nd));
            let without = logits.split_off(kept.len());
            // The ramp of MoSa and LG-Tok: none at the first scale, all of it at the last.
            let strength = sampling.guidance * scale as f64 / last;
            if strength > 0.0 {
                guide(&mut logits, &without, strength);
            }
            for (i, (row, kept)) in logits.iter().zip(kept).enumerate() {
                let Making { codes, rng, .. } = &mut *motions[i / n];
                codes.push(kept.unwrap_or_else(|| sampling.draw.any_code(row, rng)));
            }
        }
    }

    /// Sequences of text alone.
    fn with_text(&self, texts: &[&[f32]], n_latents: u32) -> Growing<'_> {
        let d_text = self.no_text.len();
        let prefixes: Vec<usize> = texts.iter().map(|text| text.len() / d_text).collect();
        let blocks = &self.model.weights.blocks;
        let mut growing = Growing::new(&self.model.backbone, blocks, prefixes);
        let p = growing.longest_text();
        let lengths: Arc<[u32]> = vec![n_latents; texts.len() * p].into();
        let x_nd = self.model.text_rows(padded(texts, p * d_text), &lengths);
        let angles = |&n: &usize| self.model.places().text(n).chain(std::iter::repeat_n(0, p - n));
        let angles: Vec<usize> = growing.prefixes().iter().flat_map(angles).collect();
        growing.text(x_nd, &angles);
        growing
    }
}

impl Sampler for ScalewiseSampler {
    fn sample(
        &self,
        prompts: &[Prompt],
        scales: &dyn ScaleInputs,
        sampling: &Sampling,
    ) -> Result<Vec<Sampled>, GeneratorError> {
        sampling.check_guidance(self.model.spec().text_drop)?;
        let motions = prompts.iter().map(|prompt| self.begin(prompt));
        let mut motions = motions.collect::<Result<Vec<Making>, _>>()?;
        let mut by_length: BTreeMap<usize, Vec<&mut Making>> = BTreeMap::new();
        for motion in &mut motions {
            by_length.entry(motion.n_frames).or_default().push(motion);
        }
        by_length.values_mut().for_each(|alike| self.make(alike, scales, sampling));
        Ok(motions.into_iter().map(Making::done).collect())
    }
}
