//! What the scales of a clip are shown of its codes.

use super::batch::Clip;
use crate::generator::Inputs;

/// A clip of so many frames whose scales are shown `codes`; text and truth are the caller's.
pub fn shown_clip<'a>(
    inputs: &Inputs,
    codes: &[u32],
    n_frames: usize,
    lengths: Vec<usize>,
    fill: impl FnOnce(Clip<'a>) -> Clip<'a>,
) -> Clip<'a> {
    let scales = inputs.scales.expect("the job opens the tokenizer for a generator that wants it");
    let n_latents = scales.n_latents(n_frames);
    let inputs = scales.inputs(codes, 1, n_frames);
    fill(Clip { text: &[], codes: &[], lengths, inputs, n_latents, supervised: 0..0 })
}
