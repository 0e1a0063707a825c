//! What is common to the sampling of every kind of generator: prompts, drawing, and what comes out.

mod draw;
mod edit;
mod form;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Serialize;

pub use draw::Draw;
pub use edit::Edit;
pub use form::{Choices, StreamForm};

use super::{GeneratorError, ScaleInputs};

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
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(self.index);
        rng
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
    fn wants_length(&self) -> bool;

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
