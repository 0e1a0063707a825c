//! [`Packing`]: the rows of latents, frames and words of a batch, clip after clip.

use std::ops::Range;
use std::sync::Arc;

use burn::tensor::Tensor;

use crate::ops::{AttentionOptions, Kernels, Rope, SequenceLayout};
use crate::spec::{Piece, Positions, TransformerSpec};

/// RMSNorm's ε, as in LLaMA and LG-Tok.
pub const EPSILON: f32 = 1e-5;

/// The base of rotary angles, LG-Tok's.
const ROPE_BASE: f64 = 100.0;

/// The rotary indices of rows.
///
/// Text comes first, with as many indices as words in the longest caption. Then latents and frames follow, each with as
/// many indices as their largest number; or they share a time axis, a latent at the middle of its span of frames.
#[derive(Clone, Debug)]
pub struct Places {
    pub heads: usize,
    head_dim: usize,
    /// Places kept for words.
    words: usize,
    /// Places kept for latents: most of a piece.
    latents: usize,
    positions: Positions,
}

impl Places {
    /// The indices of one half, with room for captions if it reads them.
    pub fn of(sizes: &TransformerSpec, sees_text: bool) -> Self {
        let longest = sizes.language.as_ref().map_or(0, |language| language.max_tokens);
        Self {
            heads: sizes.heads,
            head_dim: sizes.width / sizes.heads,
            words: if sees_text { longest } else { 0 },
            latents: sizes.most_latents(),
            positions: sizes.positions,
        }
    }

    /// The index of a latent of a piece.
    fn latent(&self, j: usize, piece: Piece) -> f64 {
        let within = match self.positions {
            Positions::Learned => j as f64,
            Positions::Rotary => piece.middle(j) - 0.5,
        };
        self.words as f64 + within
    }

    /// The index of a frame.
    fn frame(&self, i: usize) -> f64 {
        let before = match self.positions {
            Positions::Learned => self.words + self.latents,
            Positions::Rotary => self.words,
        };
        (before + i) as f64
    }

    /// The indices of the latents of a piece.
    pub fn of_latents(&self, piece: Piece) -> impl Iterator<Item = f64> {
        (0..piece.n_latents).map(move |j| self.latent(j, piece))
    }

    /// The indices of the frames of a piece.
    pub fn of_frames(&self, piece: Piece) -> impl Iterator<Item = f64> {
        (0..piece.n_frames).map(|i| self.frame(i))
    }

    /// The angles of indices.
    pub fn rope(&self, indices: impl Iterator<Item = f64>) -> Arc<Rope> {
        Arc::new(Rope::at_positions(&Vec::from_iter(indices), self.head_dim, ROPE_BASE))
    }
}

/// Rows of clips with equal numbers of latents and frames, and their own words: a clip's latents, then its frames, then
/// its words. Each row attends to all rows of its clip.
#[derive(Clone, Debug)]
pub struct Packing {
    piece: Piece,
    /// The arguments of attention over the rows.
    pub options: AttentionOptions,
    /// For each row, its index in the concatenation of all latents, all frames and all words.
    order: Arc<[u32]>,
}

impl Packing {
    /// Packs a piece of each clip; `words` has one entry a clip.
    pub fn new(piece: Piece, words: &[usize], places: &Places) -> Self {
        let (b, Piece { n_latents, n_frames }) = (words.len(), piece);
        let lengths: Vec<usize> = words.iter().map(|words| n_latents + n_frames + words).collect();
        let layout = SequenceLayout::new(&lengths, &lengths).expect("clips have frames");
        let mut order = Vec::with_capacity(layout.n_rows());
        let mut word = b * (n_latents + n_frames);
        for (clip, words) in words.iter().enumerate() {
            order.extend(clip * n_latents..(clip + 1) * n_latents);
            order.extend((b * n_latents + clip * n_frames..).take(n_frames));
            order.extend(word..word + words);
            word += words;
        }
        let longest = words.iter().copied().max().unwrap_or(0);
        let motion = places.of_latents(piece).chain(places.of_frames(piece));
        let rope = places.rope(motion.chain((0..longest).map(|word| word as f64)));
        let options = AttentionOptions::new(places.heads, Arc::new(layout), rope, EPSILON);
        let order = order.into_iter().map(|row| row as u32).collect();
        Self { piece, options, order }
    }

    /// Arranges all latents `[b·t, d]`, all frames `[b·f, d]` and all words, if any, into rows `[n, d]`.
    pub fn pack(&self, parts: Vec<Tensor<2>>) -> Tensor<2> {
        let all = Tensor::cat(parts, 0);
        Kernels::for_device(&all.device()).select_rows(all, &self.order)
    }

    /// The latents of rows, `[b·t, d]`.
    pub fn latents(&self, rows_nd: Tensor<2>) -> Tensor<2> {
        self.pick(rows_nd, 0..self.piece.n_latents)
    }

    /// The frames of rows, `[b·f, d]`.
    pub fn frames(&self, rows_nd: Tensor<2>) -> Tensor<2> {
        let Piece { n_latents, n_frames } = self.piece;
        self.pick(rows_nd, n_latents..n_latents + n_frames)
    }

    fn pick(&self, rows_nd: Tensor<2>, part: Range<usize>) -> Tensor<2> {
        let layout = &self.options.layout;
        let clips = (0..layout.n_sequences()).map(|clip| layout.rows(clip).start);
        let rows = clips.flat_map(|start| part.clone().map(move |i| (start + i) as u32));
        Kernels::for_device(&rows_nd.device()).select_rows(rows_nd, &rows.collect())
    }
}

/// Applies `of` to clips piece by piece, each with its first row; a piece has as many rows of a clip as `rows` says.
pub fn by_pieces(
    x_btc: Tensor<3>,
    pieces: Vec<Piece>,
    rows: fn(&Piece) -> usize,
    mut of: impl FnMut(Tensor<3>, usize, Piece) -> Tensor<3>,
) -> Tensor<3> {
    let mut end = 0;
    let made = pieces.into_iter().map(|piece| {
        let (start, n) = (end, rows(&piece));
        end += n;
        of(x_btc.clone().narrow(1, start, n), start, piece)
    });
    Tensor::cat(made.collect(), 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Device, TensorData};

    use crate::tokenizer::halves::host;

    fn sizes(positions: Positions) -> TransformerSpec {
        TransformerSpec { width: 8, heads: 2, span: 16, positions, ..Default::default() }
    }

    #[test]
    fn rows_come_back_from_where_they_were_packed() {
        let places = Places::of(&sizes(Positions::Learned), false);
        let piece = Piece { n_latents: 2, n_frames: 3 };
        let packing = Packing::new(piece, &[1, 0, 2], &places);
        let rows = |from: usize, n: usize| {
            let values: Vec<f32> = (from..from + n).map(|x| x as f32).collect();
            Tensor::<2>::from_data(TensorData::new(values, [n, 1]), &Device::flex())
        };
        let packed = packing.pack(vec![rows(0, 6), rows(10, 9), rows(100, 3)]);
        let first = [0.0, 1.0, 10.0, 11.0, 12.0, 100.0, 2.0, 3.0, 13.0, 14.0, 15.0, 4.0];
        assert_eq!(host(packed.clone())[..12], first);
        assert_eq!(host(packing.latents(packed.clone())), host(rows(0, 6)));
        assert_eq!(host(packing.frames(packed)), host(rows(10, 9)));
    }

    #[test]
    fn places_do_not_depend_on_how_many_there_are() {
        let indices = |positions, piece| {
            let places = Places::of(&sizes(positions), false);
            let frames: Vec<f64> = places.of_frames(piece).collect();
            (places.of_latents(piece).collect::<Vec<_>>(), frames[0], frames[frames.len() - 1])
        };
        for n in [1, 3, 4] {
            let piece = Piece { n_latents: n, n_frames: 4 * n };
            let last = (4 * n - 1) as f64;
            let learned = (vec![0.0, 1.0, 2.0, 3.0][..n].to_vec(), 4.0, 4.0 + last);
            assert_eq!(indices(Positions::Learned, piece), learned);
            let rotary = (vec![1.5, 5.5, 9.5, 13.5][..n].to_vec(), 0.0, last);
            assert_eq!(indices(Positions::Rotary, piece), rotary);
        }
    }

    #[test]
    fn a_fixed_number_of_latents_has_the_middles_of_equal_spans() {
        let own = TransformerSpec { latents: Some(2), ..sizes(Positions::Rotary) };
        let places = Places::of(&own, false);
        for (n_frames, middles) in [(4, [0.5, 2.5]), (12, [2.5, 8.5]), (16, [3.5, 11.5])] {
            let [piece] = own.pieces(n_frames)[..] else { panic!("one piece") };
            assert_eq!(places.of_latents(piece).collect::<Vec<_>>(), middles);
            assert_eq!(places.of_frames(piece).last(), Some((n_frames - 1) as f64));
        }
    }
}
