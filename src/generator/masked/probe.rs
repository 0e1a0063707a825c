//! A run of the first stage alone on made-up clips, whose steps can be timed.

use std::f64::consts::FRAC_2_PI;

use burn::tensor::Device;

use super::batch::{Hidden, pack};
use crate::generator::Probe;
use crate::generator::autoregressive::{Batch, end_token, made_up_clip, probed_on};
use crate::plan::RunSpec;
use crate::spec::ModelShape;

/// A run of the network on clips with hidden codes.
pub fn probed(spec: &RunSpec, device: &Device) -> impl Probe + use<> {
    probed_on(spec, device, |shape, n_vocab, batch_tokens| {
        let (text, codes) = made_up_clip(shape, n_vocab);
        let clip = hidden_clip(&text, &codes, n_vocab);
        batch(&clip, shape, batch_tokens)
    })
}

/// Clips of so many codes together, or a few more; and how many they are.
fn batch(clip: &Hidden, shape: &ModelShape, n_codes: usize) -> (Batch, usize) {
    let clips = vec![clip.clone(); n_codes.div_ceil(clip.shown.len())];
    (pack(&clips, shape.d_text), clips.len() * clip.shown.len())
}

/// A clip of which as many codes are hidden as in the mean of training: the mean of cos(π u / 2).
pub fn hidden_clip<'a>(text: &'a [f32], codes: &[u32], n_vocab: usize) -> Hidden<'a> {
    let n_hidden = (FRAC_2_PI * codes.len() as f64).ceil() as usize;
    let mut shown = codes.to_vec();
    shown[..n_hidden].fill(end_token(n_vocab));
    Hidden { text, shown, targets: codes[..n_hidden].iter().copied().enumerate().collect() }
}
