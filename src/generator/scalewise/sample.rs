//! Motions from the scale-by-scale transformer: a scale at a time, its codes all at once.
//!
//! Shapes: b clips of one length, n codes of a scale.

use std::collections::BTreeMap;
use std::slice;
use std::sync::Arc;

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::model::Model;
use super::own::own;
use crate::codes::Grid;
use crate::generator::stack::{Growing, padded};
use crate::generator::{Edit, GeneratorError, Prompt, Sampled, Sampler, Sampling, ScaleInputs};
use crate::learn::weights::{self, Weights};
use crate::plan::RunSpec;
use crate::spec::Precision;

/// A trained transformer.
pub struct ScalewiseSampler {
    model: Model,
    grid: Grid,
    /// The text of a caption that is left out.
    no_text: Vec<f32>,
}

/// Clips of one length that are being made.
struct Making<'a> {
    scales: &'a dyn ScaleInputs,
    n_frames: usize,
    /// Codes of each clip so far.
    codes: Vec<Vec<u32>>,
    rngs: Vec<ChaCha8Rng>,
    /// What stays of each, where a part of it is made anew.
    edits: Vec<Option<Edit<'a>>>,
    /// With each clip goes one without text, after all of them.
    guidance: f64,
}

impl Making<'_> {
    /// Sequences: the clips, and as many again where they are guided.
    fn n_sequences(&self) -> usize {
        self.codes.len() * if self.guidance > 0.0 { 2 } else { 1 }
    }

    /// What a scale after the first is shown, for all sequences.
    fn inputs(&self, scale: usize) -> Vec<f32> {
        let codes = self.codes.concat();
        let mut inputs = self.scales.inputs(&codes, self.codes.len(), self.n_frames);
        let inputs = inputs.swap_remove(scale - 1);
        inputs.repeat(self.n_sequences() / self.codes.len())
    }

    /// For each clip, the codes of a scale of `n` that stay, and `None` where one is drawn.
    fn kept(&self, n: usize) -> Vec<Vec<Option<u32>>> {
        let kept = |(edit, codes): (&Option<Edit>, &Vec<u32>)| match edit {
            None => vec![None; n],
            Some(edit) => {
                let own = &edit.codes[codes.len()..codes.len() + n];
                let places = edit.places(n).into_iter().zip(own);
                places.map(|(anew, &code)| (!anew).then_some(code)).collect()
            }
        };
        self.edits.iter().zip(&self.codes).map(kept).collect()
    }
}

impl ScalewiseSampler {
    /// The transformer of a run with its weights.
    ///
    /// # Errors
    /// [`GeneratorError::Weights`].
    pub fn new(spec: &RunSpec, weights: Weights, device: &Device) -> Result<Self, GeneratorError> {
        let mut unused = ChaCha8Rng::seed_from_u64(0);
        let (own, codes) = (own(spec), &spec.codes);
        let mut model = Model::init(own, codes, Precision::F32, &mut unused, device);
        model.weights = weights::into_module(model.weights, weights)?;
        let no_text = vec![0.0; own.shape.d_text];
        Ok(Self { model, grid: codes.clone(), no_text })
    }

    fn check(&self, prompt: &Prompt, sampling: &Sampling) -> Result<(), GeneratorError> {
        let spec = self.model.spec();
        if sampling.guidance > 0.0 && spec.text_drop == 0.0 {
            return Err(GeneratorError::Guidance);
        }
        let n_frames = prompt.n_frames.expect("the caller gives lengths where they are wanted");
        let most = spec.most_latents * spec.frames_per_latent;
        if n_frames / spec.frames_per_latent <= spec.most_latents {
            return Ok(());
        }
        let text = prompt.text.len() / spec.shape.d_text;
        let positions = text + self.grid.n_codes(n_frames);
        Err(GeneratorError::Length { n_frames, positions, n_ctx: spec.shape.n_ctx, most })
    }

    /// The codes of clips of one length.
    fn make(&self, texts: &[&[f32]], making: &mut Making, sampling: &Sampling) {
        let mut texts = texts.to_vec();
        texts.resize(making.n_sequences(), &self.no_text);
        let n_latents = making.scales.n_latents(making.n_frames) as u32;
        let mut growing = self.with_text(&texts, n_latents);
        let lengths: Vec<usize> = self.grid.lengths(making.n_frames).collect();
        let last = lengths.len().saturating_sub(1).max(1) as f64;
        for (scale, &n) in lengths.iter().enumerate() {
            let slots = making.n_sequences() * n;
            let x_nd = if scale == 0 {
                let places = (0..slots).map(|row| (row % n) as u32).collect();
                self.model.start_rows(&places, &vec![n_latents; slots].into())
            } else {
                self.model.input_rows(making.inputs(scale), &vec![scale as u32; slots].into())
            };
            let angles: Vec<usize> = (0..making.n_sequences())
                .flat_map(|_| self.model.places().scale(scale, n))
                .collect();
            let kept = making.kept(n);
            // What stays reads no text, which is about what is made anew (LG-Tok, eq. 7).
            let blind: Vec<bool> = kept.iter().flatten().map(Option::is_some).collect();
            let blind = blind.repeat(making.n_sequences() / kept.len());
            let x_nd = growing.join(x_nd, &angles, &blind);
            let logits = self.model.logits(scale, x_nd).into_data();
            let logits: Vec<f32> = logits.try_into_vec().expect("logits are f32");
            // The ramp of MoSa and LG-Tok: none at the first scale, all of it at the last.
            let strength = making.guidance * scale as f64 / last;
            draw(making, &kept, &logits, strength, sampling);
        }
    }

    /// Sequences of text alone.
    fn with_text(&self, texts: &[&[f32]], n_latents: u32) -> Growing<'_> {
        let d_text = self.no_text.len();
        let prefixes: Vec<usize> = texts.iter().map(|text| text.len() / d_text).collect();
        let mut growing = Growing::new(self.model.stack(), prefixes);
        let p = growing.longest_text();
        let lengths: Arc<[u32]> = vec![n_latents; texts.len() * p].into();
        let x_nd = self.model.text_rows(padded(texts, p * d_text), &lengths);
        let angles = |&n: &usize| self.model.places().text(n).chain(std::iter::repeat_n(0, p - n));
        let angles: Vec<usize> = growing.prefixes().iter().flat_map(angles).collect();
        growing.text(x_nd, &angles);
        growing
    }
}

/// The codes of a scale join each clip: those that are kept, and else by the rows of `[b·n, V]`, with
/// those without text after them where clips are guided.
fn draw(
    making: &mut Making,
    kept: &[Vec<Option<u32>>],
    logits: &[f32],
    strength: f64,
    sampling: &Sampling,
) {
    let n = kept[0].len();
    let n_vocab = logits.len() / (making.n_sequences() * n);
    let (with, without) = logits.split_at(making.codes.len() * n * n_vocab);
    let clips = making.codes.iter_mut().zip(&mut making.rngs).enumerate();
    for (i, (codes, rng)) in clips {
        for (slot, kept) in kept[i].iter().enumerate() {
            if let Some(code) = kept {
                codes.push(*code);
                continue;
            }
            let row = (i * n + slot) * n_vocab..(i * n + slot + 1) * n_vocab;
            let mut guided = with[row.clone()].to_vec();
            if strength > 0.0 {
                let free = without[row].iter();
                guided.iter_mut().zip(free).for_each(|(x, free)| {
                    *x += strength as f32 * (*x - free);
                });
            }
            codes.push(sampling.draw.code(&guided, slice::from_ref(&(0..n_vocab)), rng) as u32);
        }
    }
}

impl Sampler for ScalewiseSampler {
    fn wants_length(&self) -> bool {
        true
    }

    fn sample(
        &self,
        prompts: &[Prompt],
        scales: &dyn ScaleInputs,
        sampling: &Sampling,
    ) -> Result<Vec<Sampled>, GeneratorError> {
        prompts.iter().try_for_each(|prompt| self.check(prompt, sampling))?;
        let mut by_length: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (i, prompt) in prompts.iter().enumerate() {
            let n_frames = prompt.n_frames.expect("just checked");
            let n_frames = n_frames - n_frames % self.model.spec().frames_per_latent;
            by_length.entry(n_frames).or_default().push(i);
        }
        let mut made: Vec<Option<Sampled>> = vec![None; prompts.len()];
        for (n_frames, places) in by_length {
            let texts: Vec<&[f32]> = places.iter().map(|&i| prompts[i].text).collect();
            let codes = vec![Vec::new(); places.len()];
            let rngs = places.iter().map(|&i| prompts[i].rng()).collect();
            let edits = places.iter().map(|&i| prompts[i].edit).collect();
            let guidance = sampling.guidance;
            let mut making = Making { scales, n_frames, codes, rngs, edits, guidance };
            self.make(&texts, &mut making, sampling);
            for (i, codes) in places.into_iter().zip(making.codes) {
                made[i] = Some(Sampled { codes, n_frames, ended: true });
            }
        }
        Ok(made.into_iter().flatten().collect())
    }
}
