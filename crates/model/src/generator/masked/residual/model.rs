//! [`ResidualModel`]: the second stage, and [`LayerBatch`]: clips packed row after row, each asked for the
//! codes of one layer.

use std::ops::Range;
use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::codes::Grid;
use crate::generator::stack::{
    Backbone, Block, EPSILON, Supervised, heads_loss, heads_nll, kernels_of, n_supervised, packed,
};
use crate::learn::params::{constant, normal};
use crate::ops::{HeadWeights, RowLosses, SequenceLayout};
use crate::spec::{ModelShape, Precision};

/// A clip that is asked for the codes of a layer.
#[derive(Clone, Debug)]
pub struct Asked<'a> {
    /// Frozen text vectors, `[n_text, d_text]` row-major, at least one row.
    pub text: &'a [f32],
    /// The codes of the layers before, layer after layer, each from 0: `[layer, n_places]`.
    pub below: &'a [u32],
    /// The layer that is asked for, counted from 0; at least 1.
    pub layer: usize,
    /// The places that are supervised.
    pub places: Range<usize>,
    /// The layer's codes at these places.
    pub targets: &'a [u32],
}

impl<'a> Asked<'a> {
    /// A clip with codes of `n_layers` layers, of which one is asked for at some places.
    pub fn of_clip(
        text: &'a [f32],
        codes: &'a [u32],
        n_layers: usize,
        layer: usize,
        places: Range<usize>,
    ) -> Self {
        let (below, rest) = codes.split_at(codes.len() / n_layers * layer);
        Self { text, below, layer, targets: &rest[places.clone()], places }
    }

    /// Places of the clip.
    pub fn n_places(&self) -> usize {
        self.below.len() / self.layer
    }
}

/// A batch as the second stage takes it.
#[derive(Clone, Debug)]
pub struct LayerBatch {
    pub layout: Arc<SequenceLayout>,
    /// `[n_text_rows, d_text]`, all prefixes after one another.
    pub text: Vec<f32>,
    /// The embedding row that each layer adds to each position, layer by layer, `[layers, n_place_rows]`; the row after the
    /// last if the layer is hidden.
    pub shown: Arc<[u32]>,
    /// The layer that is asked for at each place, from 0 for the second: `[n_place_rows]`.
    pub layers: Arc<[u32]>,
    /// The source of each row of the batch: a text row, or `n_text_rows` + a position.
    pub order: Arc<[u32]>,
    /// The supervised codes of each layer after the first.
    pub targets: Vec<Supervised>,
    /// Places of each clip.
    pub n_places: Vec<usize>,
}

impl LayerBatch {
    /// Packs clips.
    pub fn pack(clips: &[Asked], grid: &Grid, d_text: usize) -> Self {
        let size = |clip: &Asked| [clip.text.len() / d_text, clip.n_places()];
        let sizes: Vec<[usize; 2]> = clips.iter().map(size).collect();
        let mut targets = vec![<(Vec<u32>, Vec<u32>)>::default(); grid.scales.len() - 1];
        let mut start = 0;
        for (clip, [n_text, n_places]) in clips.iter().zip(&sizes) {
            let (rows, codes) = &mut targets[clip.layer - 1];
            rows.extend(clip.places.clone().map(|place| (start + n_text + place) as u32));
            codes.extend(clip.targets);
            start += n_text + n_places;
        }
        let layers = clips.iter().zip(&sizes).flat_map(|(clip, [_, n_places])| {
            std::iter::repeat_n(clip.layer as u32 - 1, *n_places)
        });
        let (order, lengths) = packed(&sizes);
        Self {
            layout: Arc::new(SequenceLayout::new(&lengths, &lengths).expect("clips have text")),
            text: clips.iter().flat_map(|clip| clip.text).copied().collect(),
            shown: shown(clips, grid),
            layers: layers.collect(),
            order,
            targets: targets.into_iter().map(Supervised::from).collect(),
            n_places: clips.iter().map(Asked::n_places).collect(),
        }
    }

    /// Supervised codes.
    pub fn n_targets(&self) -> usize {
        n_supervised(&self.targets)
    }
}

/// Embedding rows that visible layers add to the positions of all clips.
fn shown(clips: &[Asked], grid: &Grid) -> Arc<[u32]> {
    let nothing = rows_of_embedding(grid) as u32;
    let most = clips.iter().map(|clip| clip.layer).max().unwrap_or(0);
    let layers = grid.offsets().take(most).enumerate();
    let rows = layers.flat_map(|(layer, offset)| {
        clips.iter().flat_map(move |clip| {
            let n = clip.n_places();
            let code = move |place| match layer < clip.layer {
                true => offset as u32 + clip.below[layer * n + place],
                false => nothing,
            };
            (0..n).map(code)
        })
    });
    rows.collect()
}

/// Rows of the embedding: the codes of all layers but the last.
pub fn rows_of_embedding(grid: &Grid) -> usize {
    grid.scales[..grid.scales.len() - 1].iter().map(|scale| scale.n_vocab).sum()
}

// The model: text in front, blocks over places, a head a layer.
//
// Shapes: n rows of the batch, p places of all clips, d width, K layers, V_k codes of layer k.

/// All parameters of the second stage.
#[derive(Module, Debug)]
pub struct ResidualTransformer {
    /// `[V_1 + … + V_{K−1}, d]`: the codes of each layer in order.
    embedding: Param<Tensor<2>>,
    /// Added to the places, by the layer that is asked for, `[K − 1, d]`.
    layers: Param<Tensor<2>>,
    /// `[d_text, d]`.
    text_weight: Param<Tensor<2>>,
    text_bias: Param<Tensor<1>>,
    blocks: Vec<Block>,
    norm: Param<Tensor<1>>,
    /// `[d, V_k]` each, from the second layer on; only the last layer's if the others are tied to the embedding.
    heads: Vec<Param<Tensor<2>>>,
}

impl ResidualTransformer {
    /// Draws parameters as the first stage does: N(0, 2/(5d)), bias 0.
    pub fn init(shape: &ModelShape, grid: &Grid, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let d = shape.d_model;
        let from = |n: usize| (2.0 / (5.0 * n as f64)).sqrt();
        let std = from(d);
        let n_layers = grid.scales.len();
        let tied = if shape.tie_embeddings { n_layers - 1 } else { 1 };
        let heads = grid.scales[tied..].iter();
        Self {
            embedding: normal([rows_of_embedding(grid), d], std, rng, device),
            layers: normal([n_layers - 1, d], std, rng, device),
            text_weight: normal([shape.d_text, d], from(shape.d_text) * std, rng, device),
            text_bias: constant([d], 0.0, device),
            blocks: (0..shape.n_layer).map(|_| Block::init(shape, std, rng, device)).collect(),
            norm: constant([d], 1.0, device),
            heads: heads.map(|scale| normal([d, scale.n_vocab], std, rng, device)).collect(),
        }
    }
}

/// The second stage with the non-trained inputs of its forward pass.
#[derive(Clone, Debug)]
pub struct ResidualModel {
    pub weights: ResidualTransformer,
    backbone: Backbone,
    grid: Grid,
}

impl ResidualModel {
    /// A model with drawn parameters; on an autodiff device it can be trained.
    pub fn init(
        shape: &ModelShape,
        grid: &Grid,
        precision: Precision,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let weights = ResidualTransformer::init(shape, grid, rng, device);
        let backbone = Backbone::new(shape, kernels_of(precision, device), device);
        Self { weights, backbone, grid: grid.clone() }
    }

    /// The same model without gradients and in single precision, for evaluation.
    pub fn frozen(&self) -> Self {
        let (weights, backbone) = (self.weights.valid(), self.backbone.frozen());
        Self { weights, backbone, grid: self.grid.clone() }
    }

    /// Mean cross-entropy over the batch's supervised codes, in nats, `[1]`.
    pub fn loss(&self, batch: &LayerBatch) -> Tensor<1> {
        let x_nd = self.features(batch);
        heads_loss(self.backbone.kernels, &x_nd, &batch.targets, |later| self.head(later))
    }

    /// −ln p of each supervised code of each layer after the first, in nats, and the likeliest code in its place.
    pub fn nll(&self, batch: &LayerBatch) -> Vec<RowLosses> {
        let x_nd = self.features(batch);
        heads_nll(self.backbone.kernels, &x_nd, &batch.targets, |later| self.head(later))
    }

    /// Logits over the codes of a layer, counted from 0, of the batch's rows for it, `[s, V_k]`.
    pub fn logits(&self, batch: &LayerBatch, layer: usize) -> Tensor<2> {
        let kernels = self.backbone.kernels;
        let x_sd = kernels.select_rows(self.features(batch), &batch.targets[layer - 1].rows);
        kernels.logits(x_sd, self.head(layer - 1), EPSILON)
    }

    /// The output of the blocks for all rows, `[n, d]`.
    fn features(&self, batch: &LayerBatch) -> Tensor<2> {
        let ResidualTransformer { text_weight, text_bias, blocks, .. } = &self.weights;
        let text_nd = self.backbone.projected(batch.text.clone(), text_weight, text_bias);
        let rows = Tensor::cat(vec![text_nd, self.place_rows(batch)], 0);
        let x_nd = self.backbone.kernels.select_rows(rows, &batch.order);
        self.backbone.forward(blocks, x_nd, &batch.layout)
    }

    /// The sum of the embeddings of earlier layers and of the predicted layer at each position, `[p, d]`.
    fn place_rows(&self, batch: &LayerBatch) -> Tensor<2> {
        let Backbone { shape, kernels, device, .. } = &self.backbone;
        let (places, d) = (batch.layers.len(), shape.d_model);
        let shown = batch.shown.len() / places;
        let nothing = Tensor::zeros([1, d], device);
        let table = Tensor::cat(vec![self.weights.embedding.val(), nothing], 0);
        let codes_kpd = kernels.select_rows(table, &batch.shown).reshape([shown, places, d]);
        let asked_pd = self.backbone.looked_up(&self.weights.layers, &batch.layers);
        codes_kpd.sum_dim(0).reshape([places, d]) + asked_pd
    }

    /// The head of a layer, counted from 0 for the second.
    fn head(&self, later: usize) -> HeadWeights {
        let weights = &self.weights;
        let is_tied = weights.heads.len() + 1 < self.grid.scales.len();
        let weight_dv = match is_tied && later + 2 < self.grid.scales.len() {
            true => self.tied(later + 1),
            false if is_tied => weights.heads[0].val(),
            false => weights.heads[later].val(),
        };
        HeadWeights { gamma_d: weights.norm.val(), weight_dv }
    }

    /// The embeddings of a layer's codes as columns, `[d, V_k]`.
    fn tied(&self, layer: usize) -> Tensor<2> {
        let offset = self.grid.offsets().nth(layer).expect("a layer of the grid");
        let rows = self.weights.embedding.val().narrow(0, offset, self.grid.scales[layer].n_vocab);
        rows.transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codes::{Length, Scale};

    #[test]
    fn a_clip_is_shown_the_layers_before_the_one_that_is_asked_for() {
        let scale = |n_vocab| Scale { n_vocab, length: Length::FramesPerCode(4) };
        let grid = Grid { scales: vec![scale(10), scale(20), scale(30)], end_token: false };
        let one = Asked::of_clip(&[0.5; 2], &[1, 2, 3, 4, 5, 6], 3, 1, 1..2);
        let other = Asked::of_clip(&[0.5], &[7, 8, 9], 3, 2, 0..1);
        let batch = LayerBatch::pack(&[one, other], &grid, 1);
        // Two places of one clip, one of the other; the first is not shown the second layer.
        assert_eq!(*batch.shown, [1, 2, 7, 30, 30, 10 + 8]);
        assert_eq!(*batch.layers, [0, 0, 1]);
        assert_eq!(*batch.order, [0, 1, 3, 4, 2, 5]);
        assert_eq!((&*batch.targets[0].rows, &*batch.targets[0].codes), (&[3][..], &[4][..]));
        assert_eq!((&*batch.targets[1].rows, &*batch.targets[1].codes), (&[5][..], &[9][..]));
        assert_eq!((batch.n_targets(), &batch.n_places[..]), (2, &[2, 1][..]));
    }
}
