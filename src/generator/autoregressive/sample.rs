//! Motions from the transformer: a code at a time, by what the model says of the next one.

use std::sync::Arc;

use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::decode::Decoder;
use super::transformer::Model;
use crate::codes::Grid;
use crate::generator::{
    Choices, Draw, GeneratorError, Prompt, Sampled, Sampler, Sampling, ScaleInputs, StreamForm,
};
use crate::learn::weights::{self, Weights};
use crate::plan::RunSpec;

/// A trained transformer.
pub struct AutoregressiveSampler {
    model: Model,
    grid: Grid,
}

/// A motion that is being made.
struct Growing<'a> {
    form: StreamForm<'a>,
    rng: ChaCha8Rng,
}

impl AutoregressiveSampler {
    /// The transformer of a run with its weights.
    ///
    /// # Errors
    /// [`GeneratorError::Weights`].
    pub fn new(spec: &RunSpec, weights: Weights, device: &Device) -> Result<Self, GeneratorError> {
        let mut unused = ChaCha8Rng::seed_from_u64(0);
        let mut model = Model::init(spec.shape(), spec.n_vocab(), &mut unused, device);
        model.weights = weights::into_module(model.weights, weights)?;
        Ok(Self { model, grid: spec.codes.clone() })
    }

    /// Positions left for codes after a text.
    fn room(&self, prompt: &Prompt) -> usize {
        let shape = self.model.shape();
        shape.n_ctx.saturating_sub(prompt.text.len() / shape.d_text)
    }

    fn check(&self, prompt: &Prompt) -> Result<(), GeneratorError> {
        let Some(n_frames) = prompt.n_frames else { return Ok(()) };
        let (codes, room) = (self.grid.n_codes(n_frames), self.room(prompt));
        if codes <= room {
            return Ok(());
        }
        let shape = self.model.shape();
        let (positions, n_ctx) = (codes + prompt.text.len() / shape.d_text, shape.n_ctx);
        let fits = |frames: &usize| self.grid.n_codes(*frames) <= room;
        let most = (0..n_frames).rev().find(fits).unwrap_or(0);
        Err(GeneratorError::Length { n_frames, positions, n_ctx, most })
    }
}

impl Sampler for AutoregressiveSampler {
    /// Codes of fixed numbers do not tell a length.
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
        if sampling.guidance > 0.0 {
            return Err(GeneratorError::Guidance);
        }
        if prompts.iter().any(|prompt| prompt.edit.is_some()) {
            return Err(GeneratorError::Edit);
        }
        prompts.iter().try_for_each(|prompt| self.check(prompt))?;
        let grow = |prompt: &Prompt| Growing {
            form: StreamForm::new(&self.grid, prompt.n_frames, self.room(prompt)),
            rng: prompt.rng(),
        };
        let mut growing: Vec<Growing> = prompts.iter().map(grow).collect();
        let texts: Vec<&[f32]> = prompts.iter().map(|prompt| prompt.text).collect();
        let (mut decoder, mut logits) = Decoder::new(&self.model, &texts);
        while grow_by_one(&mut growing, &logits, &sampling.draw) {
            let last = growing.iter().map(|motion| motion.form.last().unwrap_or(0));
            logits = decoder.push(&Arc::from_iter(last));
        }
        Ok(growing.into_iter().map(sampled).collect())
    }
}

/// A code joins each motion that is not whole, by its row of `[b, V + 1]`; whether any is still to grow.
fn grow_by_one(growing: &mut [Growing], logits: &Tensor<2>, draw: &Draw) -> bool {
    let [_, columns] = logits.dims();
    let logits: Vec<f32> = logits.clone().into_data().try_into_vec().expect("logits are f32");
    for (motion, row) in growing.iter_mut().zip(logits.chunks_exact(columns)) {
        if let Choices::Ids(allowed) = motion.form.choices() {
            motion.form.push(draw.code(row, &allowed, &mut motion.rng));
        }
    }
    growing.iter().any(|motion| matches!(motion.form.choices(), Choices::Ids(_)))
}

fn sampled(motion: Growing) -> Sampled {
    let ended = motion.form.choices() == Choices::Whole;
    let (codes, n_frames) = motion.form.into_codes();
    Sampled { codes, n_frames, ended }
}
