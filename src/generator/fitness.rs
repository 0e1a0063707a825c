//! Whether a run can be trained at all, before its first step.

use burn::tensor::{Device, FloatDType};

use crate::data::Split;
use crate::generator::{GeneratorError, Inputs};
use crate::plan::RunSpec;
use crate::spec::Precision;

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
