//! The language-guided transformer of LG-Tok ("Language-Guided Transformer Tokenizer for Human Motion
//! Generation" and its code).
//!
//! The encoder reads `[text | latents | motion]` and keeps the rows of the latents, which start as learned vectors; its
//! last layer is a convolution over neighbouring latents. The decoder starts with one learned vector per frame, which
//! attends to the other frames, to the latents and to the text. The layers of each half form a U: outputs of the first
//! layers are skip connections to the last ones, in reverse order.
//!
//! Differences from the published code: there are frames / 4 latents, not always 49; each half has its own projection of
//! the text; latents of the decoder have learned positions, since codes of one scale do not determine their place; text
//! is packed, not padded, at the same rotary index.
//!
//! Shapes: b clips, t latents and f frames of a clip, n rows of all clips, d width, c channels.

mod layers;
mod packing;

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::halves::{Decode, Encode, Pass};
use crate::learn::layers::Conv1d;
use crate::learn::params::constant;
use crate::motion::POSITIONS;
use crate::ops::{CrossLayout, CrossOptions, Kernels, Rope};
use crate::spec::{Detokenizer, Positions, TransformerSpec};
use layers::{Layers, Linear, Memory, Seen, deviation, learned_rows};
use packing::{Packing, Places, by_pieces};

/// Learned latents that look at frames and words.
#[derive(Module, Debug)]
pub struct TransformerEncoder {
    /// `[seen features, d]`.
    motion: Linear,
    /// `[most latents of a piece, d]`.
    latents: Param<Tensor<2>>,
    /// `[width of a word's vector, d]`.
    text: Option<Linear>,
    layers: Layers,
    /// d to c, over three neighbouring latents.
    output: Conv1d,
    #[module(skip)]
    n_seen: usize,
    #[module(skip)]
    places: Places,
}

impl TransformerEncoder {
    /// Fresh weights, that see the root and the joints' positions, as in LG-Tok.
    pub fn new(
        sizes: &TransformerSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let language = sizes.language.as_ref().filter(|own| own.places()[0]);
        let n_seen = POSITIONS.end.min(n_features);
        let (width, std) = (sizes.width, deviation(sizes.width));
        Self {
            motion: Linear::new([n_seen, width], std, rng, device),
            latents: learned_rows([sizes.most_latents(), width], rng, device),
            text: language.map(|read| Linear::new([read.dim, width], std, rng, device)),
            layers: Layers::new(sizes, [false; 2], rng, device),
            output: Conv1d::same([width, sizes.latent], 1, rng, device),
            n_seen,
            places: Places::of(sizes, language.is_some()),
        }
    }

    /// The latents of clips that are seen at once: `[b, f, seen features]` to `[b, t, c]`.
    fn piece(&self, x_bfs: Tensor<3>, pass: &mut Pass) -> Tensor<3> {
        let [b, f, s] = x_bfs.dims();
        let t = f / self.places.frames;
        let latents_td = self.latents.val().narrow(0, 0, t);
        let d = latents_td.dims()[1];
        let latents_nd = latents_td.unsqueeze::<3>().expand([b, t, d]).reshape([b * t, d]);
        let mut rows = vec![latents_nd, self.motion.forward(x_bfs.reshape([b * f, s]))];
        let (words, text_nd) = self.words(b, pass);
        rows.extend(text_nd);
        let packing = Packing::new([t, f], &words, &self.places);
        let seen = Seen { options: packing.options.clone(), latents: None, text: None };
        let rows_nd = self.layers.forward(packing.pack(rows), &seen, pass);
        self.output.forward(packing.latents(rows_nd).reshape([b, t, d]))
    }

    /// The number of words of each clip, and all of them as rows `[words, d]`; a clip with a dropped caption has
    /// none.
    fn words(&self, b: usize, pass: &Pass) -> (Vec<usize>, Option<Tensor<2>>) {
        let Some((text, captions)) = self.text.as_ref().zip(pass.captions) else {
            return (vec![0; b], None);
        };
        let vectors = captions.tensor(&text.device());
        (captions.words().to_vec(), vectors.map(|vectors| text.forward(vectors)))
    }
}

impl Encode for TransformerEncoder {
    fn forward(&self, x_btf: Tensor<3>, pass: &mut Pass) -> Tensor<3> {
        let Places { latents, frames, .. } = self.places;
        let seen = x_btf.narrow(2, 0, self.n_seen);
        by_pieces(seen, latents, frames, |x_bfs| self.piece(x_bfs, pass))
    }
}

/// One learned vector a frame that looks at frames, latents and words.
#[derive(Module, Debug)]
pub struct TransformerDecoder {
    /// c to d, over three neighbouring latents.
    input: Conv1d,
    /// The initial vector of every frame, and the vector of a dropped caption: `[1, d]`.
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
        let language = sizes.language.as_ref().filter(|own| own.places()[1]);
        let (width, std) = (sizes.width, deviation(sizes.width));
        let kind = sizes.detokenizer;
        let crosses = kind == Detokenizer::Cross;
        let crosses = [crosses, crosses && language.is_some()];
        let learned = sizes.positions == Positions::Learned;
        let latent_positions = || constant([sizes.most_latents(), width], 0.0, device);
        Self {
            input: Conv1d::same([sizes.latent, width], 1, rng, device),
            mask: learned_rows([1, width], rng, device),
            frame_positions: learned.then(|| learned_rows([sizes.span, width], rng, device)),
            latent_positions: learned.then(latent_positions),
            text: language.map(|read| Linear::new([read.dim, width], std, rng, device)),
            layers: Layers::new(sizes, crosses, rng, device),
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

    /// Angles of frames and latents by time.
    fn ropes(&self, t: usize, f: usize) -> Option<[Arc<Rope>; 2]> {
        let ropes = || [self.places.rope(0, f, 0), self.places.rope(t, 0, 0)].map(Arc::new);
        self.latent_positions.is_none().then(ropes)
    }

    /// The number of words of each clip, and all of them as rows `[words, d]`; a dropped caption is replaced by the mask's
    /// vector.
    fn words(&self, b: usize, pass: &Pass) -> (Vec<usize>, Option<Tensor<2>>) {
        let Some((text, captions)) = self.text.as_ref().zip(pass.captions) else {
            return (vec![0; b], None);
        };
        let device = text.device();
        let vectors = captions.tensor(&device).map(|vectors| text.forward(vectors));
        let n_words: usize = captions.words().iter().sum();
        let mut next = 0..;
        let of_clip = |&words: &usize| match words {
            0 => vec![n_words as u32],
            words => next.by_ref().take(words).collect(),
        };
        let rows: Vec<u32> = captions.words().iter().flat_map(of_clip).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    use crate::learn::params::normal;
    use crate::spec::{ArchitectureSpec, LanguagePlace, QuantizerSpec};
    use crate::tokenizer::halves::{Captions, host};
    use crate::tokenizer::module::{AnyDecoder, AnyEncoder};
    use crate::tokenizer::testing::{D_TEXT, transformer_spec};

    const BOTH: [LanguagePlace; 2] = [LanguagePlace::Tokenizer, LanguagePlace::Detokenizer];
    const N_FEATURES: usize = 70;

    fn sizes(at: &[LanguagePlace]) -> TransformerSpec {
        let quantizer = QuantizerSpec::Fsq { levels: vec![5, 3] };
        match transformer_spec(at, quantizer, 1).architecture {
            ArchitectureSpec::Transformer(sizes) => sizes,
            _ => unreachable!("the spec of a transformer"),
        }
    }

    fn halves_of(sizes: TransformerSpec, n_features: usize) -> (AnyEncoder, AnyDecoder) {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let (device, spec) = (Device::flex(), ArchitectureSpec::Transformer(sizes));
        let encoder = AnyEncoder::new(&spec, n_features, &mut rng, &device);
        (encoder, AnyDecoder::new(&spec, n_features, &mut rng, &device))
    }

    fn halves(sizes: TransformerSpec) -> (AnyEncoder, AnyDecoder) {
        halves_of(sizes, N_FEATURES)
    }

    fn random(shape: [usize; 3], seed: u64) -> Tensor<3> {
        normal(shape, 1.0, &mut ChaCha8Rng::seed_from_u64(seed), &Device::flex()).val()
    }

    /// Captions of so many words each.
    fn captions(words: &[usize], seed: u64) -> Captions {
        let of = |(i, &n): (usize, &usize)| {
            host(random([1, n.max(1), D_TEXT], seed + i as u64))[..n * D_TEXT].to_vec()
        };
        let all: Vec<Vec<f32>> = words.iter().enumerate().map(of).collect();
        Captions::of(all.iter().map(Vec::as_slice), D_TEXT)
    }

    fn encoded(encoder: &AnyEncoder, clips: &Tensor<3>, captions: &Captions) -> Vec<Vec<f32>> {
        let latents = encoder.forward(clips.clone(), &mut Pass::reading(Some(captions)));
        let size = latents.dims()[1] * latents.dims()[2];
        host(latents).chunks(size).map(<[f32]>::to_vec).collect()
    }

    #[test]
    fn clips_of_any_length_become_a_latent_for_four_frames_and_come_back() {
        for positions in [Positions::Learned, Positions::Rotary] {
            for detokenizer in [Detokenizer::Cross, Detokenizer::Context] {
                let (encoder, decoder) =
                    halves(TransformerSpec { positions, detokenizer, ..sizes(&[]) });
                for latents in [1, 3, 4, 5, 11] {
                    let clips = random([2, 4 * latents, N_FEATURES], 1);
                    let made = encoder.forward(clips, &mut Pass::default());
                    assert_eq!(made.dims(), [2, latents, 4]);
                    let frames = decoder.forward(made, &mut Pass::default());
                    assert_eq!(frames.dims(), [2, 4 * latents, N_FEATURES]);
                }
            }
        }
    }

    #[test]
    fn a_dropped_caption_cannot_influence_latents() {
        let (encoder, _) = halves(sizes(&BOTH));
        let clips = random([2, 12, N_FEATURES], 2);
        let with = encoded(&encoder, &clips, &captions(&[3, 5], 7));
        let dropped = encoded(&encoder, &clips, &captions(&[3, 0], 7));
        let others = encoded(&encoder, &clips, &captions(&[2, 0], 30));
        let none = encoded(&encoder, &clips, &Captions::none(2));
        assert_eq!(with[0], dropped[0], "a clip sees its own caption alone");
        assert_ne!(with[1], dropped[1], "a caption is seen");
        assert_eq!((&dropped[1], &others[1]), (&none[1], &none[1]));
        // What takes the caption's place is the detokenizer's alone.
        let (other, _) = halves(sizes(&BOTH[..1]));
        assert_eq!(encoded(&other, &clips, &captions(&[3, 0], 7)), dropped);
    }

    #[test]
    fn the_detokenizer_sees_a_caption_and_that_it_is_missing() {
        for detokenizer in [Detokenizer::Cross, Detokenizer::Context] {
            let (_, decoder) = halves(TransformerSpec { detokenizer, ..sizes(&BOTH) });
            let latents = random([2, 3, 4], 3);
            let made = |captions: &Captions| {
                host(decoder.forward(latents.clone(), &mut Pass::reading(Some(captions))))
            };
            let size = 12 * N_FEATURES;
            let with = made(&captions(&[3, 5], 7));
            let dropped = made(&captions(&[3, 0], 7));
            let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(close(&with[..size], &dropped[..size]));
            assert!(!close(&with[size..], &dropped[size..]));
            let AnyDecoder::Transformer(mut moved) = decoder.clone() else { unreachable!() };
            moved.shift_mask();
            let pass = &mut Pass::reading(None);
            let without = captions(&[0, 0], 7);
            pass.captions = Some(&without);
            let before = made(&without);
            let after = host(AnyDecoder::Transformer(moved).forward(latents.clone(), pass));
            assert!(!close(&after, &before));
        }
    }

    #[test]
    fn dropout_follows_from_its_stream() {
        let (encoder, _) = halves(sizes(&[]));
        let clips = random([1, 8, N_FEATURES], 2);
        let made = |seed: Option<u64>| {
            let noise = seed.map(ChaCha8Rng::seed_from_u64);
            host(encoder.forward(clips.clone(), &mut Pass { captions: None, noise }))
        };
        assert_eq!(made(Some(1)), made(Some(1)));
        assert_ne!(made(Some(1)), made(Some(2)));
        assert_ne!(made(Some(1)), made(None));
    }

    #[test]
    fn at_the_sizes_of_the_paper_the_halves_have_about_its_parameters() {
        let mut sizes = sizes(&BOTH);
        (sizes.width, sizes.layers, sizes.heads, sizes.latent, sizes.span) = (256, 9, 4, 512, 196);
        sizes.language.as_mut().unwrap().dim = 2048;
        let text = (2048 + 1) * 256;
        let (encoder, decoder) = halves_of(sizes, 67);
        let [encoder, decoder] = [encoder.num_params() - text, decoder.num_params() - text];
        // 10.4 and 15.2 million, to which the latents' learned positions add 49 x 256.
        assert!((10_350_000..10_450_000).contains(&encoder), "{encoder}");
        assert!((15_150_000..15_265_000).contains(&decoder), "{decoder}");
    }
}
