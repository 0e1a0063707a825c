//! [`PatchEncoder`] and [`PatchDecoder`].
//!
//! Shapes: b clips, t frames, f features, s frames of a patch, k channels of a latent, n = b·t/s.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::block::Block;
use super::components::{Components, Line, components, line};
use crate::learn::layers::Affine;
use crate::motion::POSITIONS;
use crate::spec::PatchSpec;
use crate::tokenizer::architecture::{Decode, Encode};
use crate::tokenizer::pass::Pass;

/// Dilations of blocks, over and over.
const DILATIONS: [usize; 3] = [1, 2, 4];

fn blocks(n: usize, width: usize, rng: &mut ChaCha8Rng, device: &Device) -> Vec<Block> {
    let dilations = DILATIONS.into_iter().cycle().take(n);
    dilations.map(|dilation| Block::new(width, dilation, rng, device)).collect()
}

/// Principal components of each patch, and what a network adds to them.
#[derive(Module, Debug)]
pub struct PatchEncoder {
    components: Affine,
    input: Affine,
    blocks: Vec<Block>,
    output: Affine,
    #[module(skip)]
    frames: usize,
    #[module(skip)]
    n_seen: usize,
}

impl PatchEncoder {
    /// Fresh weights; the network sees the root and the joints' positions.
    pub fn new(
        sizes: &PatchSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let &PatchSpec { width, frames, latent, encoder_blocks, .. } = sizes;
        let n_seen = POSITIONS.end.min(n_features);
        Self {
            components: Affine::new(frames * n_features, latent, rng, device).fixed(),
            input: Affine::new(frames * n_seen, width, rng, device),
            blocks: blocks(encoder_blocks, width, rng, device),
            output: Affine::zero(width, latent, device),
            frames,
            n_seen,
        }
    }
}

impl Encode for PatchEncoder {
    fn forward(&self, x_btf: Tensor<3>, _: &mut Pass) -> Tensor<3> {
        let [b, t, f] = x_btf.dims();
        let n = b * t / self.frames;
        let begun = self.components.forward(x_btf.clone().reshape([n, self.frames * f]));
        let seen = x_btf.narrow(2, 0, self.n_seen).reshape([n, self.frames * self.n_seen]);
        let added = through(&self.input, &self.blocks, &self.output, seen, b);
        let k = begun.dims()[1];
        (begun + added).reshape([b, t / self.frames, k])
    }

    fn begin(&mut self, patches_np: &Tensor<2>) {
        let f = patches_np.dims()[1] / self.frames;
        let k = self.components.channels_out();
        let Components { weight, bias } = components(patches_np, f, k);
        self.components.set(weight, bias);
    }
}

/// A line from each latent to its patch, and what a network adds to it.
#[derive(Module, Debug)]
pub struct PatchDecoder {
    line: Affine,
    input: Affine,
    blocks: Vec<Block>,
    output: Affine,
    #[module(skip)]
    frames: usize,
}

impl PatchDecoder {
    /// Fresh weights.
    pub fn new(
        sizes: &PatchSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let &PatchSpec { width, frames, latent, decoder_blocks, .. } = sizes;
        Self {
            line: Affine::new(latent, frames * n_features, rng, device),
            input: Affine::new(latent, width, rng, device),
            blocks: blocks(decoder_blocks, width, rng, device),
            output: Affine::zero(width, frames * n_features, device),
            frames,
        }
    }
}

impl Decode for PatchDecoder {
    fn forward(&self, latents_btc: Tensor<3>, _: &mut Pass) -> Tensor<3> {
        let [b, t, k] = latents_btc.dims();
        let latents_nk = latents_btc.reshape([b * t, k]);
        let begun = self.line.forward(latents_nk.clone());
        let added = through(&self.input, &self.blocks, &self.output, latents_nk, b);
        let p = begun.dims()[1];
        (begun + added).reshape([b, t * self.frames, p / self.frames])
    }

    fn begin(&mut self, latents_nk: &Tensor<2>, patches_np: &Tensor<2>) {
        let Line { weight, bias } = line(latents_nk, patches_np);
        self.line.set(weight, bias);
    }
}

/// Rows of `b` clips through a layer, blocks and a layer.
fn through(
    input: &Affine,
    blocks: &[Block],
    output: &Affine,
    x_nc: Tensor<2>,
    b: usize,
) -> Tensor<2> {
    let n = x_nc.dims()[0];
    let hidden_nw = input.forward(x_nc);
    let w = hidden_nw.dims()[1];
    let hidden_btw = hidden_nw.reshape([b, n / b, w]);
    let hidden_btw = blocks.iter().fold(hidden_btw, |x, block| block.forward(x));
    output.forward(hidden_btw.reshape([n, w]))
}
