//! A tokenizer as what generators of several scales are shown.

use crate::generator::ScaleInputs;
use crate::tokenizer::{Extent, Tokenizer};

impl ScaleInputs for Tokenizer {
    fn inputs(&self, codes: &[u32], n_clips: usize, n_frames: usize) -> Vec<Vec<f32>> {
        let extent = Extent { n_clips, n_latents: self.n_latents(n_frames) };
        let inputs = self.quantizer().inputs(codes, extent).into_iter();
        inputs.map(|x| x.into_data().try_into_vec().expect("latents are f32")).collect()
    }

    fn n_latents(&self, n_frames: usize) -> usize {
        n_frames / self.spec().architecture.frames_per_latent()
    }
}
