//! What is common to the sampling of every kind of generator: prompts, drawing, and what comes out.

mod draw;
mod edit;
mod form;

use rand_chacha::ChaCha8Rng;
use serde::Serialize;

pub use draw::{Draw, guide, guided, rows};
pub use edit::Edit;
pub use form::{Choices, StreamForm};

use super::{GeneratorError, ScaleInputs};
use crate::learn::params::stream;

/// What a motion is made from.
#[derive(Clone, Copy, Debug)]
pub struct Prompt<'a> {
    /// Frozen text vectors, `[n_text, d_text]` row-major, at least one row.
    pub text: &'a [f32],
    /// The length asked for; `None` leaves it to the model.
    pub n_frames: Option<usize>,
    pub seed: u64,
    /// Tells motions of one seed apart: each draws from its own stream of random numbers.
    pub index: u64,
    /// A clip of the length asked for that is made anew in part; `None` makes all of the motion.
    pub edit: Option<Edit<'a>>,
}

impl Prompt<'_> {
    /// The random numbers of the motion.
    pub fn rng(&self) -> ChaCha8Rng {
        stream(self.seed, self.index)
    }
}

/// Whether motions of so many frames fit a context, by the positions that they take with their text.
///
/// # Errors
/// [`GeneratorError::Length`].
pub fn check_length(
    n_frames: usize,
    n_ctx: usize,
    positions: impl Fn(usize) -> usize,
) -> Result<(), GeneratorError> {
    let fits = |frames: &usize| positions(*frames) <= n_ctx;
    if fits(&n_frames) {
        return Ok(());
    }
    let most = (0..n_frames).rev().find(fits).unwrap_or(0);
    Err(GeneratorError::Length { n_frames, positions: positions(n_frames), n_ctx, most })
}

/// A motion that is being made.
pub struct Making<'a> {
    pub text: &'a [f32],
    pub rng: ChaCha8Rng,
    /// Its codes so far, scale after scale.
    pub codes: Vec<u32>,
    pub n_frames: usize,
    /// What stays of it, where a part is made anew.
    edit: Option<Edit<'a>>,
}

impl<'a> Making<'a> {
    /// A motion without a code.
    pub fn new(prompt: &Prompt<'a>, n_frames: usize) -> Self {
        let Prompt { text, edit, .. } = *prompt;
        Self { text, rng: prompt.rng(), codes: Vec::new(), n_frames, edit }
    }

    /// Of each of `n` codes of a scale that stands behind `before` codes, the code where it stays.
    pub fn kept(&self, before: usize, n: usize) -> Vec<Option<u32>> {
        self.edit.map_or_else(|| vec![None; n], |edit| edit.kept(before, n))
    }

    /// The motion, which has met its length.
    pub fn done(self) -> Sampled {
        Sampled { codes: self.codes, n_frames: self.n_frames, ended: true }
    }
}

/// How motions are made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sampling {
    pub draw: Draw,
    /// How far logits move away from those without text (classifier-free guidance, Ho and Salimans
    /// 2022): (1 + s) conditional − s unconditional. 0 for none.
    pub guidance: f64,
    /// Rounds in which a masked model shows its codes.
    pub rounds: usize,
}

impl Default for Sampling {
    fn default() -> Self {
        Self { draw: Draw::default(), guidance: 0.0, rounds: 10 }
    }
}

impl Sampling {
    /// Whether a model can be guided that was trained without this share of the captions.
    ///
    /// # Errors
    /// [`GeneratorError::Guidance`].
    pub fn check_guidance(&self, text_drop: f64) -> Result<(), GeneratorError> {
        let refused = self.guidance > 0.0 && text_drop == 0.0;
        if refused { Err(GeneratorError::Guidance) } else { Ok(()) }
    }
}

/// The codes of a motion that was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sampled {
    /// As a tokenizer gives them: scale after scale.
    pub codes: Vec<u32>,
    /// Frames that they stand for.
    pub n_frames: usize,
    /// Whether the model ended the motion, or had a length to meet; if not, its context was full.
    pub ended: bool,
}

/// A trained generator that makes motions.
pub trait Sampler {
    /// Whether a prompt has to say how long the motion is.
    fn wants_length(&self) -> bool {
        true
    }

    /// Whether motions can be moved away from those without text.
    fn takes_guidance(&self) -> bool {
        true
    }

    /// Makes a motion of each prompt, all at once; `scales` is what the generator's
    /// [`Inputs::scales`](super::Inputs::scales) was.
    ///
    /// # Errors
    /// [`GeneratorError::Length`]: a length that the model has no room for;
    /// [`GeneratorError::Guidance`]: it has never seen a motion without its text.
    fn sample(
        &self,
        prompts: &[Prompt],
        scales: &dyn ScaleInputs,
        sampling: &Sampling,
    ) -> Result<Vec<Sampled>, GeneratorError>;
}
