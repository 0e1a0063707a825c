//! The language-guided transformer of LG-Tok ("Language-Guided Transformer Tokenizer for Human Motion
//! Generation" and its code).
//!
//! The encoder reads `[text | latents | motion]` and keeps the rows of the latents, which start as learned vectors; its
//! last layer is a convolution over neighbouring latents. The decoder starts with one learned vector per frame, which
//! attends to the other frames, to the latents and to the text. The layers of each half form a U: outputs of the first
//! layers are skip connections to the last ones, in reverse order.
//!
//! Differences from the published code: without `latents` there are frames / 4 latents, not always 49; each half has its
//! own projection of the text; latents of the decoder have learned positions, since codes of one scale do not determine
//! their place; text is packed, not padded, at the same rotary index.
//!
//! Shapes: b clips, t latents and f frames of a clip, n rows of all clips, d width, c channels.

mod layers;
mod packing;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::halves::{Decode, Encode, Pass};
use crate::learn::layers::Conv1d;
use crate::learn::params::constant;
use crate::motion::POSITIONS;
use crate::ops::{CrossLayout, CrossOptions, Kernels, Rope};
use crate::spec::{Detokenizer, Piece, Positions, TransformerSpec};
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
    #[module(skip)]
    sizes: TransformerSpec,
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
            sizes: sizes.clone(),
        }
    }

    /// The latents of a piece of clips: `[b, f, seen features]` to `[b, t, c]`.
    fn piece(&self, x_bfs: Tensor<3>, piece: Piece, pass: &mut Pass) -> Tensor<3> {
        let ([b, f, s], t) = (x_bfs.dims(), piece.n_latents);
        let latents_td = self.latents.val().narrow(0, 0, t);
        let d = latents_td.dims()[1];
        let latents_nd = latents_td.unsqueeze::<3>().expand([b, t, d]).reshape([b * t, d]);
        let mut rows = vec![latents_nd, self.motion.forward(x_bfs.reshape([b * f, s]))];
        let (words, text_nd) = self.words(b, pass);
        rows.extend(text_nd);
        let packing = Packing::new(piece, &words, &self.places);
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
        let pieces = self.sizes.pieces(x_btf.dims()[1]);
        let seen = x_btf.narrow(2, 0, self.n_seen);
        let frames = |piece: &Piece| piece.n_frames;
        by_pieces(seen, pieces, frames, |x_bfs, _, piece| self.piece(x_bfs, piece, pass))
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
    places: Places,
    #[module(skip)]
    sizes: TransformerSpec,
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
        let crosses = sizes.detokenizer == Detokenizer::Cross;
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
            places: Places::of(sizes, language.is_some()),
            sizes: sizes.clone(),
        }
    }

    /// The frames of a piece of clips whose first latent is `from`: `[b, t, c]` to `[b, f, features]`.
    fn piece(
        &self,
        latents_btc: Tensor<3>,
        from: usize,
        piece: Piece,
        pass: &mut Pass,
    ) -> Tensor<3> {
        let [b, t, _] = latents_btc.dims();
        let (f, n_head) = (piece.n_frames, self.places.heads);
        let latents_nd = self.latents(latents_btc);
        let queries_nd = self.queries(b, f);
        let rows_nd = match self.sizes.detokenizer {
            Detokenizer::Cross => {
                let frames_alone = Piece { n_latents: 0, ..piece };
                let packing = Packing::new(frames_alone, &vec![0; b], &self.places);
                let memory = |rows_md, queries: &[usize], counts: &[usize], ropes| {
                    let layout = Arc::new(CrossLayout::new(queries, counts));
                    Memory { rows_md, options: CrossOptions::new(n_head, layout, ropes) }
                };
                let groups = groups(piece, from, pass);
                let (words, text_nd) = self.words(b, &groups, pass);
                let readers = groups.iter().map(|group| group.frames).collect::<Vec<_>>().repeat(b);
                let ropes = self.ropes(piece);
                let seen = Seen {
                    options: packing.options.clone(),
                    latents: Some(memory(latents_nd, &vec![f; b], &vec![t; b], ropes)),
                    text: text_nd.map(|text_md| memory(text_md, &readers, &words, None)),
                };
                self.layers.forward(queries_nd, &seen, pass)
            }
            Detokenizer::Context => {
                let (words, text_nd) = self.words(b, &[Group { frames: f, reads: true }], pass);
                let packing = Packing::new(piece, &words, &self.places);
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
    fn ropes(&self, piece: Piece) -> Option<[Arc<Rope>; 2]> {
        let Self { places, .. } = self;
        let ropes =
            || [places.rope(places.of_frames(piece)), places.rope(places.of_latents(piece))];
        self.latent_positions.is_none().then(ropes)
    }

    /// The number of words that each group of each clip reads, and all of them as rows `[words, d]`; the mask's vector is
    /// in the place of a dropped caption, and of a caption that is not read.
    fn words(&self, b: usize, groups: &[Group], pass: &Pass) -> (Vec<usize>, Option<Tensor<2>>) {
        let Some((text, captions)) = self.text.as_ref().zip(pass.captions) else {
            return (vec![0; b * groups.len()], None);
        };
        let device = text.device();
        let vectors = captions.tensor(&device).map(|vectors| text.forward(vectors));
        let n_words: usize = captions.words().iter().sum();
        let (mut counts, mut rows, mut first) = (Vec::new(), Vec::new(), 0);
        for &words in captions.words() {
            for group in groups {
                let is_read = group.reads && words > 0;
                let own = if is_read { first..first + words } else { n_words..n_words + 1 };
                counts.push(own.len());
                rows.extend(own.map(|row| row as u32));
            }
            first += words;
        }
        let all = Tensor::cat(vectors.into_iter().chain([self.mask.val()]).collect(), 0);
        (counts, Some(Kernels::for_device(&device).select_rows(all, &rows.into())))
    }
}

/// Neighbouring frames of a clip, and whether they read its caption.
struct Group {
    frames: usize,
    reads: bool,
}

/// The frames of a piece whose first latent is `from`, in groups that read alike.
fn groups(piece: Piece, from: usize, pass: &Pass) -> Vec<Group> {
    let is_read_by = |latent| pass.captions.is_none_or(|captions| captions.is_read_by(latent));
    let frames = 0..piece.n_frames;
    let reads: Vec<bool> = frames.map(|frame| is_read_by(from + piece.latent_of(frame))).collect();
    let runs = reads.chunk_by(|a, b| a == b);
    runs.map(|run| Group { frames: run.len(), reads: run[0] }).collect()
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
    fn forward(&self, latents_blc: Tensor<3>, n_frames: usize, pass: &mut Pass) -> Tensor<3> {
        let (pieces, latents) = (self.sizes.pieces(n_frames), |piece: &Piece| piece.n_latents);
        by_pieces(latents_blc, pieces, latents, |part_btc, from, piece| {
            self.piece(part_btc, from, piece, pass)
        })
    }
}
