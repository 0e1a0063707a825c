//! [`Inputs`]: the input of every kind of generator, its check against a run, and the errors of a run.

use burn::tensor::{Device, FloatDType};

use crate::codes::TokenStore;
use crate::data::Split;
use crate::failure::FailureKind;
use crate::learn::weights::WeightsError;
use crate::learn::{Cause, LearnError, TrainingError};
use crate::spec::{Precision, RunSpec};
use crate::text::TextStore;

/// The input of a run, mapped and shared with parallel runs.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    pub tokens: &'a TokenStore,
    pub text: &'a TextStore,
    /// Converts codes to the inputs of scales, if the generator needs it.
    pub scales: Option<&'a dyn ScaleInputs>,
}

/// A tokenizer, for generators that make codes scale after scale.
pub trait ScaleInputs {
    /// The inputs of all scales but the first, `[b, s, c]` row-major: the sum of the contributions of earlier scales to the
    /// latents, resized to the scale. The codes are of `n_clips` clips of `n_frames` frames, clip by clip, scale by scale.
    /// A prefix of the scales is allowed; returns one input per given scale, except after the last.
    fn inputs(&self, codes: &[u32], n_clips: usize, n_frames: usize) -> Vec<Vec<f32>>;
}

// [`GeneratorError`]: why a run ends without a result.

/// Why a run ended without a result.
#[derive(Debug, thiserror::Error)]
pub enum GeneratorError {
    /// Learning ended before its end.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// Codes and spec do not belong together.
    #[error("the tokens have {found} codes, the run wants {wanted}")]
    Vocabulary { found: usize, wanted: usize },
    /// A clip is longer than the model's context.
    #[error(
        "clip {clip} of the {split} split takes {positions} positions with its text, the model \
         has {n_ctx}: raise model.motion_slots by {}",
        positions - n_ctx
    )]
    Context { split: &'static str, clip: usize, positions: usize, n_ctx: usize },
    /// A motion that was asked for is longer than the model's context.
    #[error(
        "a motion of {n_frames} frames takes {positions} positions with its text, the model has \
         {n_ctx}: ask for at most {most} frames"
    )]
    Length { n_frames: usize, positions: usize, n_ctx: usize, most: usize },
    /// A motion that was asked for is shorter than a code.
    #[error("a motion of {n_frames} frames has no code: ask for at least {least} frames")]
    NoCode { n_frames: usize, least: usize },
    /// Guidance by a model that was trained with every caption.
    #[error(
        "the run was trained with every caption, so that guidance has nothing to move away from: \
         leave guidance at 0, or train with model.text_drop above 0"
    )]
    Guidance,
    /// Weights that do not fit the run.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The device does not compute in the run's precision.
    #[error("the device does not compute in {0}: set train.precision to {other}", other = others(.0))]
    Precision(&'static str),
}

impl TrainingError for GeneratorError {
    fn cause(&self) -> Cause<'_> {
        Cause::Other(match self {
            Self::Learn(error) => return Cause::Learn(error),
            Self::Weights(error) => error.failure_kind(),
            Self::Precision(_) => FailureKind::Other,
            _ => FailureKind::BadData,
        })
    }
}

/// The alternative to a precision.
fn others(precision: &str) -> &'static str {
    if precision == "f16" { "bf16 or f32" } else { "f16 or f32" }
}

// Whether a run can be trained at all, before its first step.

/// Tokens must have the codes that the model has, and their sequences fit its context.
pub fn check_inputs(spec: &RunSpec, inputs: &Inputs) -> Result<(), GeneratorError> {
    let (found, wanted) = (inputs.tokens.n_vocab(), spec.n_vocab());
    if found != wanted {
        return Err(GeneratorError::Vocabulary { found, wanted });
    }
    Split::ALL.into_iter().try_for_each(|split| check_lengths(spec, inputs, split))
}

/// Devices differ in the numbers that they compute in.
pub fn check_precision(precision: Precision, device: &Device) -> Result<(), GeneratorError> {
    let dtype = match precision {
        Precision::F32 => return Ok(()),
        Precision::F16 => FloatDType::F16,
        Precision::Bf16 => FloatDType::BF16,
    };
    let supported = device.supports_dtype(dtype);
    supported.then_some(()).ok_or(GeneratorError::Precision(precision.name()))
}

/// Each clip must fit the context after the longest of its captions.
fn check_lengths(spec: &RunSpec, inputs: &Inputs, split: Split) -> Result<(), GeneratorError> {
    let (Inputs { tokens, text, .. }, n_ctx) = (inputs, spec.shape().n_ctx);
    let n_text = |&caption: &u32| text.embedding(caption).len() / text.dim();
    for clip in 0..tokens.n_clips(split) {
        let longest_text = text.captions(split, clip).iter().map(n_text).max().unwrap_or(0);
        let n_frames = tokens.clip_frames(split, clip);
        let positions = longest_text + spec.generator.positions(tokens.grid(), n_frames);
        if positions > n_ctx {
            return Err(GeneratorError::Context { split: split.name(), clip, positions, n_ctx });
        }
    }
    Ok(())
}
