//! LG-Tok's scale-by-scale transformer (after MoSa and VAR): predicts all codes of a scale at once, from the text, the
//! length of the clip and the earlier scales.
//!
//! A sequence is `[text | scale 1 | scale 2 | …]`. The rows of scale 1 are learned; those of a later scale are the sum
//! of the earlier scales' contributions to the tokenizer's latents, resized to its length and projected. A row attends
//! to the text and all rows of its own and earlier scales, and codes at the same time have the same angle. Text is in
//! front, as in the autoregressive transformer; the released code uses cross-attention.

mod batch;
mod model;

use std::collections::BTreeMap;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use super::autoregressive::{Part, TokenStream};
use super::kind::step_rng;
use super::losses::{SplitSums, passes};
use super::probed::WORDS;
use super::sampling::{Making, guide, rows};
use super::stack::{Growing, padded};
use super::{
    GeneratorError, Inputs, Kind, Objective, Prompt, Sampled, Sampler, Sampling, ScaleInputs,
    SplitLoss,
};
use crate::codes::Grid;
use crate::data::Split;
use crate::draws::{below, unit};
use crate::progress::moved;
use crate::spec::{RunSpec, exact_of_clip};
use model::own;

pub use batch::{Batch, Clip};
pub use model::{Model, ScalewiseTransformer};

/// The scale-by-scale transformer as a kind of generator.
pub struct Scalewise;

impl Kind for Scalewise {
    type Network = Model;
    type Objective<'a> = EachScale<'a>;

    const WANTS_SCALES: bool = true;

    fn sampler(spec: &RunSpec, model: Model) -> Box<dyn Sampler> {
        let no_text = vec![0.0; spec.shape().d_text];
        Box::new(ScalewiseSampler { model, grid: spec.codes.clone(), no_text })
    }

    /// Clips as long as the longest.
    fn made_up(spec: &RunSpec, model: &Model) -> (Batch, usize) {
        let own = model.spec();
        let lengths = own.longest(&spec.codes);
        let n_codes: usize = lengths.iter().sum();
        let words = WORDS.min(own.shape.n_ctx - n_codes).max(1);
        let (text, codes) = (vec![0.5; own.shape.d_text * words], vec![0; n_codes]);
        let clip = Clip {
            text: &text,
            codes: &codes,
            inputs: lengths.iter().skip(1).map(|n| vec![0.5; n * own.d_latent]).collect(),
            lengths,
            length: own.most_latents,
            supervised: 0..n_codes,
        };
        let clips = vec![clip; spec.batch_tokens.div_ceil(n_codes)];
        let batch = Batch::pack(&clips, &spec.codes, own.shape.d_text, model.places());
        (batch, clips.len() * n_codes)
    }
}

// [`EachScale`]: the batches of a run of the scale-by-scale transformer.

/// The cross-entropy of the codes of each scale, given those before it.
///
/// As MoSa trains: a share of the codes is shown as random ones, and a share of the captions as one
/// vector of zeros. MoSa weighs its last scale as much as all others together; here every code counts
/// alike, so that the loss is the likelihood that laws are about.
pub struct EachScale<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
    /// The text of a caption that is left out.
    no_text: Vec<f32>,
}

impl EachScale<'_> {
    fn clip(&self, part: Part, rng: &mut ChaCha8Rng) -> Clip<'_> {
        let dropped = unit(rng) < own(self.spec).text_drop;
        let text = if dropped { &self.no_text } else { self.inputs.text.embedding(part.caption) };
        let inputs = (self.inputs, &self.spec.codes, own(self.spec).frames_per_latent);
        let (clip, about) = ((Split::Train, part.clip), (text, part.targets));
        Clip::of(inputs, clip, about, |codes, lengths| self.corrupted(codes, lengths, rng))
    }

    /// Codes of which a share is replaced by random ones of their scale.
    fn corrupted(&self, codes: &[u32], lengths: &[usize], rng: &mut ChaCha8Rng) -> Vec<u32> {
        let share = own(self.spec).corruption;
        let scales = self.spec.codes.scales.iter().zip(lengths);
        let vocabularies = scales.flat_map(|(scale, &n)| std::iter::repeat_n(scale.n_vocab, n));
        let shown = codes.iter().zip(vocabularies).map(|(&code, n_vocab)| {
            if unit(rng) < share { below(rng, n_vocab) as u32 } else { code }
        });
        shown.collect()
    }
}

impl<'a> Objective<'a> for EachScale<'a> {
    type Network = Model;

    fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self {
        let stream = TokenStream::new(inputs.tokens, inputs.text, spec.seed);
        let stream = stream.over(spec.share).showing(spec.captions);
        Self { spec, inputs, stream, no_text: vec![0.0; spec.shape().d_text] }
    }

    fn batch(&mut self, model: &Model, step: usize) -> (Batch, f64) {
        let n = self.spec.batch_tokens;
        let parts = self.stream.parts(step * n, n);
        let mut rng = step_rng(self.spec, step);
        let clips: Vec<Clip> = parts.into_iter().map(|part| self.clip(part, &mut rng)).collect();
        let batch = Batch::pack(&clips, &self.spec.codes, self.inputs.text.dim(), model.places());
        let forward_flops = forward_flops(self.spec, &batch);
        (batch, forward_flops)
    }

    fn split_loss(&self, model: &Model, split: Split) -> SplitLoss {
        split_loss(&model.frozen(), self.inputs, split)
    }

    /// For the largest scale: a uniform guess is no worse on others.
    fn uniform_nats(&self) -> f64 {
        let largest = self.spec.codes.scales.iter().map(|scale| scale.n_vocab).max();
        (largest.unwrap_or(1) as f64).ln()
    }
}

/// Multiply-adds of a batch, times two: each clip at its own lengths, the heads per target.
fn forward_flops(spec: &RunSpec, batch: &Batch) -> f64 {
    let (own, layout) = (own(spec), &batch.layout);
    let no_heads = vec![0; spec.codes.scales.len()];
    let clip = |i: usize| {
        let lengths = layout.block_lengths(i);
        exact_of_clip(own, &spec.codes, layout.prefix(i), &lengths, &no_heads)
    };
    let clips = (0..layout.n_sequences()).map(clip);
    let heads = spec.codes.scales.iter().zip(&batch.targets);
    let heads = heads.map(|(scale, own)| (2 * own.codes.len() * scale.n_vocab) as f64);
    clips.sum::<f64>() + spec.shape().d_model as f64 * heads.sum::<f64>()
}

// The loss on a split, by scale and as a whole.

/// Measures a model, each clip once with one of its captions, shown its own codes.
fn split_loss(model: &Model, inputs: &Inputs, split: Split) -> SplitLoss {
    let (tokens, text) = (inputs.tokens, inputs.text);
    let shown_by = (inputs, tokens.grid(), model.spec().frames_per_latent);
    let mut sums = SplitSums::by_scale(tokens, split);
    for clips in passes(tokens, split) {
        let shown = clips.clone().map(|clip| {
            let supervised = 0..tokens.clip(split, clip).len();
            let about = (text.shown(split, clip), supervised);
            Clip::of(shown_by, (split, clip), about, |codes, _| codes.to_vec())
        });
        let shown: Vec<Clip> = shown.collect();
        let batch = Batch::pack(&shown, tokens.grid(), text.dim(), model.places());
        sums.add_scales(0, (&model.nll(&batch), &batch.targets), &clips);
        moved();
    }
    sums.loss()
}

// Motions from the scale-by-scale transformer: a scale at a time, its codes all at once.
//
// Shapes: b clips of one length, n codes of a scale.

/// A trained transformer.
struct ScalewiseSampler {
    model: Model,
    grid: Grid,
    /// The text of a caption that is left out.
    no_text: Vec<f32>,
}

impl ScalewiseSampler {
    /// A motion without a code, of whole strides.
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
        let length = (n_frames / self.model.spec().frames_per_latent) as u32;
        let mut growing = self.with_text(&texts, length);
        let lengths: Vec<usize> = self.grid.lengths(n_frames).collect();
        let last = lengths.len().saturating_sub(1).max(1) as f64;
        for (scale, &n) in lengths.iter().enumerate() {
            let slots = n_sequences * n;
            let x_nd = if scale == 0 {
                let places = (0..slots).map(|row| (row % n) as u32).collect();
                self.model.start_rows(&places, &vec![length; slots].into())
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
            let x_nd = growing.join(x_nd, &angles);
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
    fn with_text(&self, texts: &[&[f32]], length: u32) -> Growing<'_> {
        let d_text = self.no_text.len();
        let prefixes: Vec<usize> = texts.iter().map(|text| text.len() / d_text).collect();
        let blocks = &self.model.weights.blocks;
        let mut growing = Growing::new(&self.model.backbone, blocks, prefixes);
        let p = growing.longest_text();
        let lengths: Arc<[u32]> = vec![length; texts.len() * p].into();
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
