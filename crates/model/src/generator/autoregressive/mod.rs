//! ScaMo's text-prefix autoregressive transformer: model, batches, training, loss, sampling.
//!
//! Codes of several scales are one sequence, scale by scale, and the codebooks one vocabulary: V is their sum. Such
//! clips have no end token, since the lengths of the scales determine the end; its row and its logit are unused, so a
//! model has the same shape for every grid.

mod stream;
mod transformer;

use std::borrow::Cow;
use std::sync::Arc;

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;

use super::losses::{SplitSums, passes};
use super::probed::{MOST_TOKENS, made_up_clip};
use super::sampling::{check_length, rows};
use super::{
    Draw, GeneratorError, Inputs, Kind, Objective, Prompt, Sampled, Sampler, Sampling, ScaleInputs,
    SplitLoss,
};
use crate::codes::Grid;
use crate::data::Split;
use crate::progress::moved;
use crate::spec::RunSpec;
use crate::spec::flops::exact_of_sequence;
use stream::{Choices, StreamForm};
use transformer::Decoder;

pub use stream::{Part, TokenStream};
pub use transformer::{Batch, Model, Sequence, Transformer, end_token};

/// Logits of a measured step, at most.
const MOST_LOGITS: usize = 1 << 24;

/// Tokens of a measured step, a few more apart.
pub fn probed_tokens(spec: &RunSpec) -> usize {
    spec.batch_tokens.min(MOST_TOKENS).min(MOST_LOGITS / spec.n_vocab())
}

/// The text-prefix autoregressive transformer as a kind of generator.
pub struct Autoregressive;

impl Kind for Autoregressive {
    type Network = Model;
    type Objective<'a> = NextCode<'a>;

    fn sampler(spec: &RunSpec, model: Model) -> Box<dyn Sampler> {
        Box::new(AutoregressiveSampler { model, grid: spec.codes.clone() })
    }

    fn made_up(spec: &RunSpec, model: &Model) -> (Batch, usize) {
        let (shape, n_vocab) = (model.shape(), spec.n_vocab());
        let (text, codes) = made_up_clip(shape, n_vocab);
        let to = codes.len() + 1;
        let clips = probed_tokens(spec).div_ceil(to);
        let sequence = Sequence { text: &text, codes: &codes, from: 0, to };
        let batch = Batch::pack(&vec![sequence; clips], shape.d_text, end_token(n_vocab));
        (batch, clips * to)
    }
}

// [`NextCode`]: the batches of a run of the transformer.

/// The cross-entropy of each next code.
pub struct NextCode<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
}

impl<'a> Objective<'a> for NextCode<'a> {
    type Network = Model;

    fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self {
        let stream = TokenStream::new(inputs.tokens, inputs.text, spec.seed);
        let stream = stream.over(spec.share).showing(spec.captions);
        Self { spec, inputs, stream }
    }

    fn batch(&mut self, _: &Model, step: usize) -> (Batch, f64) {
        let n = self.spec.batch_tokens;
        let batch = self.stream.batch(step * n, n);
        let forward_flops = forward_flops(self.spec, &batch);
        (batch, forward_flops)
    }

    fn split_loss(&self, model: &Model, split: Split) -> SplitLoss {
        split_loss(&model.frozen(), self.inputs, split)
    }

    fn uniform_nats(&self) -> f64 {
        ((self.spec.n_vocab() + 1) as f64).ln()
    }
}

/// Multiply-adds of a batch, times two: each sequence at its own length, the head per target.
fn forward_flops(spec: &RunSpec, batch: &Batch) -> f64 {
    let layout = &batch.layout;
    let head = 2.0 * (spec.shape().d_model * (spec.n_vocab() + 1)) as f64;
    let blocks = (0..layout.n_sequences()).map(|i| {
        let prefix = layout.prefix(i) as f64;
        let targets = layout.len(i) as f64 - prefix + 1.0;
        exact_of_sequence(spec.shape(), spec.n_vocab(), prefix, targets) - targets * head
    });
    blocks.sum::<f64>() + batch.targets.len() as f64 * head
}

// The loss on a split: cross-entropy, and its normalised form.

/// Measures a model, each clip once with one of its captions.
pub fn split_loss(model: &Model, inputs: &Inputs, split: Split) -> SplitLoss {
    let Inputs { tokens, text, .. } = *inputs;
    let mut sums = SplitSums::new(tokens, split, vec![tokens.stream_log_probs()]);
    for clips in passes(tokens, split) {
        let streams: Vec<Cow<[u32]>> =
            clips.clone().map(|clip| tokens.stream(split, clip)).collect();
        let to = |clip| tokens.n_targets_of_clip(split, clip);
        let sequences = clips.clone().zip(&streams).map(|(clip, codes)| Sequence {
            text: text.shown(split, clip),
            codes,
            from: 0,
            to: to(clip),
        });
        let sequences: Vec<Sequence> = sequences.collect();
        let batch = Batch::pack(&sequences, text.dim(), end_token(tokens.n_vocab()));
        let losses = model.nll(&batch);
        sums.add(0, (&losses.nats, &batch.targets), clips.clone().map(|clip| (clip, to(clip))));
        let mut likeliest = &losses.likeliest[..];
        for clip in clips {
            count_clip(&mut sums, clip, &likeliest[..to(clip)]);
            likeliest = &likeliest[to(clip)..];
        }
        moved();
    }
    sums.loss()
}

/// Counts the likeliest ids in the places of a clip, scale after scale; its end token is last, if it has one.
fn count_clip(sums: &mut SplitSums, clip: usize, mut likeliest: &[u32]) {
    for scale in 0..sums.tokens.grid().scales.len() {
        let (own, later) = likeliest.split_at(sums.tokens.scale(sums.split, clip, scale).len());
        sums.count(scale, own);
        likeliest = later;
    }
}

// Samples motions from the transformer, one code at a time.

/// A trained transformer.
struct AutoregressiveSampler {
    model: Model,
    grid: Grid,
}

/// A motion that is being made.
struct Growing<'a> {
    form: StreamForm<'a>,
    rng: ChaCha8Rng,
    /// The codes to come of a motion that is edited, each if it is kept.
    kept: std::vec::IntoIter<Option<u32>>,
}

impl AutoregressiveSampler {
    fn check(&self, prompt: &Prompt) -> Result<(), GeneratorError> {
        let Some(n_frames) = prompt.n_frames else { return Ok(()) };
        let shape = self.model.shape();
        let n_text = prompt.text.len() / shape.d_text;
        check_length(n_frames, shape.n_ctx, |frames| self.grid.n_codes(frames) + n_text)
    }

    /// A motion without a code, and as much room as its text leaves.
    fn begin(&self, prompt: &Prompt) -> Growing<'_> {
        let shape = self.model.shape();
        let room = shape.n_ctx.saturating_sub(prompt.text.len() / shape.d_text);
        let lengths = prompt.n_frames.into_iter().flat_map(|frames| self.grid.lengths(frames));
        let kept = prompt.edit.map_or_else(Vec::new, |edit| edit.kept_of_all(lengths));
        let form = StreamForm::new(&self.grid, prompt.n_frames, room);
        Growing { form, rng: prompt.rng(), kept: kept.into_iter() }
    }
}

impl Sampler for AutoregressiveSampler {
    /// A fixed number of codes does not determine a length.
    fn wants_length(&self) -> bool {
        self.grid.frames_per_code().is_none()
    }

    fn takes_guidance(&self) -> bool {
        false
    }

    fn sample(
        &self,
        prompts: &[Prompt],
        _: &dyn ScaleInputs,
        sampling: &Sampling,
    ) -> Result<Vec<Sampled>, GeneratorError> {
        sampling.check_guidance(0.0)?;
        prompts.iter().try_for_each(|prompt| self.check(prompt))?;
        let mut growing: Vec<Growing> = prompts.iter().map(|prompt| self.begin(prompt)).collect();
        let texts: Vec<&[f32]> = prompts.iter().map(|prompt| prompt.text).collect();
        let (mut decoder, mut logits) = Decoder::new(&self.model, &texts);
        while grow_by_one(&mut growing, logits, &sampling.draw) {
            let last = growing.iter().map(|motion| motion.form.last().unwrap_or(0));
            logits = decoder.push(&Arc::from_iter(last));
        }
        Ok(growing.into_iter().map(sampled).collect())
    }
}

/// A code joins each motion that is not whole, kept or drawn by its row of `[b, V + 1]`; whether any is still to grow.
fn grow_by_one(growing: &mut [Growing], logits: Tensor<2>, draw: &Draw) -> bool {
    for (motion, row) in growing.iter_mut().zip(rows(logits)) {
        if let Choices::Ids(allowed) = motion.form.choices() {
            // The codes of a motion of known length, as an edited one is, are of one scale at a time.
            let kept = motion.kept.next().flatten().map(|code| allowed[0].start + code as usize);
            let drawn = || draw.code(&row, &allowed, &mut motion.rng);
            motion.form.push(kept.unwrap_or_else(drawn));
        }
    }
    growing.iter().any(|motion| matches!(motion.form.choices(), Choices::Ids(_)))
}

fn sampled(motion: Growing) -> Sampled {
    let ended = motion.form.choices() == Choices::Whole;
    let (codes, n_frames) = motion.form.into_codes();
    Sampled { codes, n_frames, ended }
}
