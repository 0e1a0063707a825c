//! [`TransformerDecoder`]: latents, and the words of a caption, to frames.

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::attention::Memory;
use super::config::{deviation, languages, learned_rows};
use super::layer::{Crossing, Layers, Seen};
use super::linear::Linear;
use super::packing::{Packing, Places, by_pieces};
use crate::learn::layers::Conv1d;
use crate::learn::params::constant;
use crate::ops::{CrossLayout, CrossOptions, Kernels, Rope};
use crate::spec::{Detokenizer, Positions, TransformerSpec};
use crate::tokenizer::architecture::Decode;
use crate::tokenizer::pass::Pass;

/// One learned vector a frame that looks at frames, latents and words.
#[derive(Module, Debug)]
pub struct TransformerDecoder {
    /// c to d, over three neighbouring latents.
    input: Conv1d,
    /// What every frame begins as, and what stands for a caption that is left out: `[1, d]`.
    mask: Param<Tensor<2>>,
    /// Added to each frame, `[most frames of a piece, d]`.
    frame_positions: Option<Param<Tensor<2>>>,
    /// Added to each latent, `[most latents of a piece, d]`.
    latent_positions: Option<Param<Tensor<2>>>,
    /// `[width of a word's vector, d]`.
    text: Option<Linear>,
    layers: Layers,
    /// d to the features.
    output: Linear,
    #[module(skip)]
    kind: Detokenizer,
    #[module(skip)]
    places: Places,
}

impl TransformerDecoder {
    /// Fresh weights; learned positions begin at 0.
    pub fn new(
        sizes: &TransformerSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let [_, language] = languages(sizes);
        let (width, std) = (sizes.width, deviation(sizes.width));
        let kind = sizes.detokenizer;
        let crosses = kind == Detokenizer::Cross;
        let crossing = Crossing { latents: crosses, text: crosses && language.is_some() };
        let learned = sizes.positions == Positions::Learned;
        let positions = |n: usize| learned.then(|| constant([n, width], 0.0, device));
        Self {
            input: Conv1d::same([sizes.latent, width], 1, rng, device),
            mask: learned_rows([1, width], rng, device),
            frame_positions: learned.then(|| learned_rows([sizes.span, width], rng, device)),
            latent_positions: positions(sizes.most_latents()),
            text: language.map(|read| Linear::new([read.dim, width], std, rng, device)),
            layers: Layers::new(sizes, crossing, rng, device),
            output: Linear::new([width, n_features], std, rng, device),
            kind,
            places: Places::of(sizes, language.is_some()),
        }
    }

    /// The frames of clips that are seen at once: `[b, t, c]` to `[b, f, features]`.
    fn piece(&self, latents_btc: Tensor<3>, pass: &mut Pass) -> Tensor<3> {
        let [b, t, _] = latents_btc.dims();
        let (f, n_head) = (t * self.places.frames, self.places.heads);
        let latents_nd = self.latents(latents_btc);
        let queries_nd = self.queries(b, f);
        let (words, text_nd) = self.words(b, pass);
        let rows_nd = match self.kind {
            Detokenizer::Cross => {
                let packing = Packing::new([0, f], &vec![0; b], &self.places);
                let memory = |rows_md, counts: &[usize], ropes| {
                    let layout = Arc::new(CrossLayout::new(&vec![f; b], counts));
                    Memory { rows_md, options: CrossOptions { n_head, layout, ropes } }
                };
                let seen = Seen {
                    options: packing.options.clone(),
                    latents: Some(memory(latents_nd, &vec![t; b], self.ropes(t, f))),
                    text: text_nd.map(|text_md| memory(text_md, &words, None)),
                };
                self.layers.forward(queries_nd, &seen, pass)
            }
            Detokenizer::Context => {
                let packing = Packing::new([t, f], &words, &self.places);
                let rows = [latents_nd, queries_nd].into_iter().chain(text_nd).collect();
                let seen = Seen { options: packing.options.clone(), latents: None, text: None };
                packing.frames(self.layers.forward(packing.pack(rows), &seen, pass))
            }
        };
        let features = self.output.forward(rows_nd);
        let n_features = features.dims()[1];
        features.reshape([b, f, n_features])
    }

    /// Latents with their positions, `[b·t, d]`.
    fn latents(&self, latents_btc: Tensor<3>) -> Tensor<2> {
        let latents_btd = self.input.forward(latents_btc);
        let [b, t, d] = latents_btd.dims();
        let placed = match &self.latent_positions {
            Some(positions) => latents_btd + positions.val().narrow(0, 0, t).unsqueeze::<3>(),
            None => latents_btd,
        };
        placed.reshape([b * t, d])
    }

    /// The vector of every frame with its position, `[b·f, d]`.
    fn queries(&self, b: usize, f: usize) -> Tensor<2> {
        let mask_1d = self.mask.val();
        let d = mask_1d.dims()[1];
        let placed_fd = match &self.frame_positions {
            Some(positions) => positions.val().narrow(0, 0, f) + mask_1d,
            None => mask_1d.expand([f, d]),
        };
        placed_fd.unsqueeze::<3>().expand([b, f, d]).reshape([b * f, d])
    }

    /// Angles of frames and latents, where they stand in time.
    fn ropes(&self, t: usize, f: usize) -> Option<[Arc<Rope>; 2]> {
        self.latent_positions.is_none().then(|| self.places.apart(t, f).map(Arc::new))
    }

    /// How many words each clip has, and all of them as rows `[words, d]`; the mask's vector alone
    /// stands for a caption that is left out.
    fn words(&self, b: usize, pass: &Pass) -> (Vec<usize>, Option<Tensor<2>>) {
        let Some((text, captions)) = self.text.as_ref().zip(pass.captions) else {
            return (vec![0; b], None);
        };
        let device = text.device();
        let vectors = captions.tensor(&device).map(|vectors| text.forward(vectors));
        let n_words: usize = captions.words().iter().sum();
        let mut next = 0..;
        let rows: Vec<u32> = captions
            .words()
            .iter()
            .flat_map(|&words| match words {
                0 => vec![n_words as u32],
                words => next.by_ref().take(words).collect(),
            })
            .collect();
        let all = Tensor::cat(vectors.into_iter().chain([self.mask.val()]).collect(), 0);
        let rows_nd = Kernels::for_device(&device).select_rows(all, &rows.into());
        (captions.words().iter().map(|&words| words.max(1)).collect(), Some(rows_nd))
    }
}

#[cfg(test)]
impl TransformerDecoder {
    /// Moves the vector that stands for a caption that is left out.
    pub fn shift_mask(&mut self) {
        let moved = self.mask.val() + 1.0;
        self.mask = Param::initialized(self.mask.id, moved);
    }
}

impl Decode for TransformerDecoder {
    fn forward(&self, latents_btc: Tensor<3>, pass: &mut Pass) -> Tensor<3> {
        by_pieces(latents_btc, self.places.latents, 1, |part_btc| self.piece(part_btc, pass))
    }
}
