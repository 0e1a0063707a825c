//! [`Packing`]: the rows of latents, frames and words of a batch, clip after clip.

use std::ops::Range;
use std::sync::Arc;

use burn::tensor::Tensor;

use crate::ops::{AttentionOptions, Kernels, Rope, SequenceLayout};
use crate::spec::{Positions, TransformerSpec};

/// RMSNorm's ε, as in LLaMA and LG-Tok.
pub const EPSILON: f32 = 1e-5;

/// The base of rotary angles, LG-Tok's.
const ROPE_BASE: f64 = 100.0;

/// The rotary indices of rows.
///
/// Text comes first, with as many indices as words in the longest caption. Then latents and frames follow, each with as
/// many indices as their largest number; or they share a time axis, a latent at the middle of its frames.
#[derive(Clone, Debug)]
pub struct Places {
    pub heads: usize,
    head_dim: usize,
    /// Places kept for words.
    words: usize,
    /// Places kept for latents: most of a piece.
    pub latents: usize,
    /// Frames of a latent.
    pub frames: usize,
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
            frames: sizes.frames,
            positions: sizes.positions,
        }
    }

    /// The index of a latent.
    fn latent(&self, j: usize) -> f64 {
        let within = match self.positions {
            Positions::Learned => j as f64,
            Positions::Rotary => (j as f64 + 0.5) * self.frames as f64 - 0.5,
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

    /// Angles of latents, of frames, then of words.
    pub fn rope(&self, latents: usize, frames: usize, words: usize) -> Rope {
        let latents = (0..latents).map(|j| self.latent(j));
        let frames = (0..frames).map(|i| self.frame(i));
        let positions: Vec<f64> =
            latents.chain(frames).chain((0..words).map(|w| w as f64)).collect();
        Rope::at_positions(&positions, self.head_dim, ROPE_BASE)
    }
}

/// Rows of clips with equal numbers of latents and frames, and their own words: a clip's latents, then its frames, then
/// its words. Each row attends to all rows of its clip.
#[derive(Clone, Debug)]
pub struct Packing {
    n_latents: usize,
    n_frames: usize,
    /// The arguments of attention over the rows.
    pub options: AttentionOptions,
    /// For each row, its index in the concatenation of all latents, all frames and all words.
    order: Arc<[u32]>,
}

impl Packing {
    /// Packs clips; `words` has one entry a clip.
    pub fn new([n_latents, n_frames]: [usize; 2], words: &[usize], places: &Places) -> Self {
        let b = words.len();
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
        let (layout, rope) =
            (Arc::new(layout), Arc::new(places.rope(n_latents, n_frames, longest)));
        let options = AttentionOptions::new(places.heads, layout, rope, EPSILON);
        let order = order.into_iter().map(|row| row as u32).collect();
        Self { n_latents, n_frames, options, order }
    }

    /// Arranges all latents `[b·t, d]`, all frames `[b·f, d]` and all words, if any, into rows `[n, d]`.
    pub fn pack(&self, parts: Vec<Tensor<2>>) -> Tensor<2> {
        let all = Tensor::cat(parts, 0);
        Kernels::for_device(&all.device()).select_rows(all, &self.order)
    }

    /// The latents of rows, `[b·t, d]`.
    pub fn latents(&self, rows_nd: Tensor<2>) -> Tensor<2> {
        self.pick(rows_nd, 0..self.n_latents)
    }

    /// The frames of rows, `[b·f, d]`.
    pub fn frames(&self, rows_nd: Tensor<2>) -> Tensor<2> {
        self.pick(rows_nd, self.n_latents..self.n_latents + self.n_frames)
    }

    fn pick(&self, rows_nd: Tensor<2>, part: Range<usize>) -> Tensor<2> {
        let layout = &self.options.layout;
        let clips = (0..layout.n_sequences()).map(|clip| layout.rows(clip).start);
        let rows = clips.flat_map(|start| part.clone().map(move |i| (start + i) as u32));
        Kernels::for_device(&rows_nd.device()).select_rows(rows_nd, &rows.collect())
    }
}

/// Applies `of` to clips piece by piece, with at most `most` latents each; a latent covers `stride` rows of a
/// clip.
pub fn by_pieces(
    x_btc: Tensor<3>,
    most: usize,
    stride: usize,
    mut of: impl FnMut(Tensor<3>) -> Tensor<3>,
) -> Tensor<3> {
    let mut start = 0;
    let pieces = pieces(x_btc.dims()[1] / stride, most).map(|latents| {
        let rows = latents * stride;
        start += rows;
        of(x_btc.clone().narrow(1, start - rows, rows))
    });
    Tensor::cat(pieces.collect(), 1)
}

/// The sizes of as few pieces of `n` latents as have `most` or fewer each, as equal as may be.
fn pieces(n: usize, most: usize) -> impl Iterator<Item = usize> {
    let count = n.div_ceil(most).max(1);
    (0..count).map(move |i| n * (i + 1) / count - n * i / count)
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
        let packing = Packing::new([2, 3], &[1, 0, 2], &places);
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
        let learned = Places::of(&sizes(Positions::Learned), false);
        assert_eq!([learned.latent(3), learned.frame(0), learned.frame(15)], [3.0, 4.0, 19.0]);
        let rotary = Places::of(&sizes(Positions::Rotary), false);
        assert_eq!([rotary.latent(0), rotary.latent(3), rotary.frame(15)], [1.5, 13.5, 15.0]);
    }

    #[test]
    fn long_clips_are_parted_evenly() {
        let of = |n, most| pieces(n, most).collect::<Vec<_>>();
        assert_eq!(
            (of(16, 16), of(17, 16), of(49, 16)),
            (vec![16], vec![8, 9], vec![12, 12, 12, 13])
        );
        assert_eq!(of(3, 16), [3]);
    }
}
