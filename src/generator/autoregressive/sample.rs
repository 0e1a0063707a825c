//! Motions from the transformer: a code at a time, by what the model says of the next one.

use std::sync::Arc;

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;

use super::decode::Decoder;
use super::transformer::Model;
use crate::codes::Grid;
use crate::generator::sampling::{check_length, rows};
use crate::generator::{
    Choices, Draw, GeneratorError, Prompt, Sampled, Sampler, Sampling, ScaleInputs, StreamForm,
};

/// A trained transformer.
pub struct AutoregressiveSampler {
    pub model: Model,
    pub grid: Grid,
}

/// A motion that is being made.
struct Growing<'a> {
    form: StreamForm<'a>,
    rng: ChaCha8Rng,
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
        Growing { form: StreamForm::new(&self.grid, prompt.n_frames, room), rng: prompt.rng() }
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
        sampling.check_guidance(0.0)?;
        if prompts.iter().any(|prompt| prompt.edit.is_some()) {
            return Err(GeneratorError::Edit);
        }
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

/// A code joins each motion that is not whole, by its row of `[b, V + 1]`; whether any is still to grow.
fn grow_by_one(growing: &mut [Growing], logits: Tensor<2>, draw: &Draw) -> bool {
    for (motion, row) in growing.iter_mut().zip(rows(logits)) {
        if let Choices::Ids(allowed) = motion.form.choices() {
            motion.form.push(draw.code(&row, &allowed, &mut motion.rng));
        }
    }
    growing.iter().any(|motion| matches!(motion.form.choices(), Choices::Ids(_)))
}

fn sampled(motion: Growing) -> Sampled {
    let ended = motion.form.choices() == Choices::Whole;
    let (codes, n_frames) = motion.form.into_codes();
    Sampled { codes, n_frames, ended }
}
