//! Arguments of the operations other than activations, and shape checks with the same messages for every
//! implementation.

use std::sync::Arc;

use burn::tensor::{Device, Tensor};

use super::padded::{PaddedBatch, PaddedPair, Placed};
use super::{CrossLayout, Rope, SequenceLayout};

/// The arguments of attention, besides tensors.
#[derive(Debug, Clone)]
pub struct AttentionOptions {
    pub n_head: usize,
    /// The sequences of the batch, and their mask.
    pub layout: Arc<SequenceLayout>,
    /// Angles of the positions.
    pub rope: Arc<Rope>,
    /// RMSNorm's ε.
    pub epsilon: f32,
    /// The layout as burn's operations take it.
    placed: Placed<PaddedBatch>,
}

impl AttentionOptions {
    /// Those of the layers of one batch, which share the layout's tensors.
    pub fn new(n_head: usize, layout: Arc<SequenceLayout>, rope: Arc<Rope>, epsilon: f32) -> Self {
        Self { n_head, layout, rope, epsilon, placed: Placed::default() }
    }

    /// The layout of the padded batch, on a device.
    pub(super) fn padded(&self, device: &Device) -> PaddedBatch {
        self.placed.on(device, || PaddedBatch::new(&self.layout, &self.rope, device))
    }

    /// Checks the shapes of rows, and of the weight of `[q | k | v]`.
    pub(super) fn check(&self, [n, d]: [usize; 2], [_, columns]: [usize; 2]) {
        let Self { n_head, layout, rope, .. } = self;
        let (rows, head_dim) = (layout.n_rows(), rope.head_dim());
        assert_eq!(n, rows, "attention: {n} rows for a layout of {rows}");
        assert!(
            d == n_head * head_dim && columns == 3 * d,
            "attention: {columns} columns are not [q | k | v] of {n_head} heads of {head_dim}"
        );
        let (places, max_len) = (layout.n_angles(), rope.max_len());
        assert!(places <= max_len, "attention: {places} positions, angles for {max_len}");
    }
}

/// The arguments of attention to a memory, besides tensors.
#[derive(Debug, Clone)]
pub struct CrossOptions {
    pub n_head: usize,
    pub layout: Arc<CrossLayout>,
    /// Angles of the queries of a sequence, and of the rows of its memory; none are turned without.
    pub ropes: Option<[Arc<Rope>; 2]>,
    /// The layout as burn's operations take it.
    placed: Placed<PaddedPair>,
}

impl CrossOptions {
    /// Those of the layers of one batch, which share the layout's tensors.
    pub fn new(n_head: usize, layout: Arc<CrossLayout>, ropes: Option<[Arc<Rope>; 2]>) -> Self {
        Self { n_head, layout, ropes, placed: Placed::default() }
    }

    /// The layout of padded queries and memories, on a device.
    pub(super) fn padded(&self, device: &Device) -> PaddedPair {
        self.placed.on(device, || PaddedPair::new(&self.layout, self.ropes.as_ref(), device))
    }

    /// Sees that shapes fit them: of queries, and of `[k | v]`.
    pub(super) fn check(&self, [n, d]: [usize; 2], [m, columns]: [usize; 2]) {
        let Self { n_head, layout, ropes, .. } = self;
        let rows = [layout.n_queries(), layout.n_memory()];
        assert_eq!([n, m], rows, "cross_attend: queries and memory of the layout");
        assert_eq!(columns, 2 * d, "cross_attend: [k | v] beside queries of {d} columns");
        assert!(d.is_multiple_of(*n_head), "cross_attend: {n_head} heads in {d} columns");
        let Some([of_queries, of_memory]) = ropes else { return };
        let angles = |rope: &Rope| (rope.head_dim() == d / n_head).then(|| rope.max_len());
        let fits = |rope, longest: Option<usize>| angles(rope) >= longest;
        let queries = layout.query_rows().map(|rows| rows.len()).max();
        let memory = layout.memory_rows().map(|rows| rows.len()).max();
        assert!(
            fits(of_queries, queries) && fits(of_memory, memory),
            "cross_attend: an angle for each row of a head"
        );
    }
}

/// Parameters of the attention half of a block.
#[derive(Debug, Clone)]
pub struct AttentionWeights {
    /// RMSNorm's scale.
    pub gamma_d: Tensor<1>,
    pub qkv_d3d: Tensor<2>,
    pub output_dd: Tensor<2>,
}

/// Parameters of the feed-forward half of a block.
#[derive(Debug, Clone)]
pub struct FeedForwardWeights {
    /// RMSNorm's scale.
    pub gamma_d: Tensor<1>,
    /// u is the width required by the activation.
    pub up_du: Tensor<2>,
    pub down_fd: Tensor<2>,
}

/// Parameters of the head.
#[derive(Debug, Clone)]
pub struct HeadWeights {
    /// RMSNorm's scale.
    pub gamma_d: Tensor<1>,
    pub weight_dv: Tensor<2>,
}

/// The results of the head for s rows, outside autodiff.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RowLosses {
    /// Cross-entropy of each row, in nats, `[s]`.
    pub nats: Vec<f64>,
    /// The column of the largest logit of each row, `[s]`.
    pub likeliest: Vec<u32>,
}

/// The activation between the two products of a feed-forward layer of f hidden features.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activation {
    /// LLaMA's gated one (Shazeer 2020), of u = 2 f columns `[gate | up]`; with σ the logistic
    /// function of gate, y = gate σ up; ∂gate = g up σ (1 + gate (1 − σ)), ∂up = g gate σ.
    SwiGlu,
    /// x Φ(x), with Φ(x) = (1 + erf(x / √2)) / 2 (Hendrycks and Gimpel 2016), of u = f columns;
    /// ∂x = g (Φ(x) + x φ(x)).
    Gelu,
}

impl Activation {
    /// Sees that shapes fit it: of rows, and of the weights before and after it.
    pub(super) fn check(self, [_, d]: [usize; 2], [rows, u]: [usize; 2], [f, columns]: [usize; 2]) {
        let wanted = match self {
            Activation::SwiGlu => 2 * f,
            Activation::Gelu => f,
        };
        assert_eq!(
            [rows, columns, u],
            [d, d, wanted],
            "feed_forward: rows of {d}, {f} hidden features"
        );
    }
}

/// The input frames of each output frame of a convolution; frames beyond a clip are zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Taps {
    /// The frame itself (kernel 1).
    Point,
    /// The frame and its neighbours at this distance (kernel 3, padding = dilation).
    Neighbours(usize),
    /// Four frames for every second one (kernel 4, stride 2, padding 1); the frames must be even.
    Halving,
    /// The frame and its neighbours after each was repeated (nearest upsampling, then kernel 3).
    Doubling,
}

impl Taps {
    /// k.
    pub fn count(self) -> usize {
        self.offsets().len()
    }

    /// Frames made of `t`.
    pub fn frames_out(self, t: usize) -> usize {
        match self {
            Taps::Point | Taps::Neighbours(_) => t,
            Taps::Halving => t / 2,
            Taps::Doubling => 2 * t,
        }
    }

    fn offsets(self) -> &'static [isize] {
        match self {
            Taps::Point => &[0],
            Taps::Neighbours(_) | Taps::Doubling => &[-1, 0, 1],
            Taps::Halving => &[-1, 0, 1, 2],
        }
    }

    /// The frames that frame `i` is made of, tap by tap, of a clip of `t` frames; `None` beyond it.
    pub fn sources(self, i: usize, t: usize) -> impl Iterator<Item = Option<usize>> {
        let (step, stride, repeat) = match self {
            Taps::Point => (1, 1, 1),
            Taps::Neighbours(dilation) => (dilation, 1, 1),
            Taps::Halving => (1, 2, 1),
            Taps::Doubling => (1, 1, 2),
        };
        self.offsets().iter().map(move |offset| {
            let place = (stride * i).checked_add_signed(offset * step as isize)?;
            (place < repeat * t).then_some(place / repeat)
        })
    }
}

/// A convolution of clips of one length, packed frame after frame, clip after clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Convolution {
    pub n_clips: usize,
    pub taps: Taps,
    /// Whether max(x, 0) is read in place of x.
    pub rectify: bool,
}

impl Convolution {
    /// Rows made of `rows`.
    pub fn rows_out(&self, rows: usize) -> usize {
        self.n_clips * self.taps.frames_out(rows / self.n_clips)
    }

    /// For each row made, in their order, the rows of `rows` that it is made of, tap by tap.
    pub fn sources(
        &self,
        rows: usize,
    ) -> impl Iterator<Item = impl Iterator<Item = Option<usize>>> {
        let (taps, t) = (self.taps, rows / self.n_clips);
        (0..self.n_clips).flat_map(move |clip| {
            (0..taps.frames_out(t))
                .map(move |i| taps.sources(i, t).map(move |frame| Some(clip * t + frame?)))
        })
    }

    /// Sees that shapes fit it: of rows, weight and bias.
    pub(super) fn check(self, [n, c]: [usize; 2], [rows, o]: [usize; 2], [columns]: [usize; 1]) {
        let Self { n_clips, taps, .. } = self;
        assert_eq!([rows, o], [taps.count() * c, columns], "convolve: {c} channels, {taps:?}");
        assert!(n_clips > 0 && n.is_multiple_of(n_clips), "convolve: {n} rows of {n_clips} clips");
        let whole = taps != Taps::Halving || (n / n_clips).is_multiple_of(2);
        assert!(whole, "clips are cropped to whole tokens before they are encoded");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_made_of_their_neighbours_within_the_clip() {
        let sources = |taps: Taps, i| taps.sources(i, 4).collect::<Vec<_>>();
        assert_eq!(sources(Taps::Neighbours(3), 2), [None, Some(2), None]);
        assert_eq!(sources(Taps::Halving, 0), [None, Some(0), Some(1), Some(2)]);
        assert_eq!(sources(Taps::Halving, 1), [Some(1), Some(2), Some(3), None]);
        assert_eq!(sources(Taps::Doubling, 0), [None, Some(0), Some(0)]);
        assert_eq!(sources(Taps::Doubling, 7), [Some(3), Some(3), None]);
        let pair = Convolution { n_clips: 2, taps: Taps::Point, rectify: false };
        let rows: Vec<_> = pair.sources(4).flatten().collect();
        assert_eq!(rows, [0, 1, 2, 3].map(Some));
    }
}
