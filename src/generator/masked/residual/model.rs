//! The model: text in front, blocks over places, a head a layer.
//!
//! Shapes: n rows of the batch, p places of all clips, d width, K layers, V_k codes of layer k.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::batch::{LayerBatch, rows_of_embedding};
use crate::codes::Grid;
use crate::generator::stack::{Backbone, Block, EPSILON, heads_loss, heads_nll, kernels_of};
use crate::learn::params::{constant, normal};
use crate::ops::HeadWeights;
use crate::spec::{ModelShape, Precision};

/// All parameters of the second stage.
#[derive(Module, Debug)]
pub struct ResidualTransformer {
    /// `[V_1 + … + V_{K−1}, d]`: the codes of each layer after those of the one before it.
    embedding: Param<Tensor<2>>,
    /// Added to the places, by the layer that is asked for, `[K − 1, d]`.
    layers: Param<Tensor<2>>,
    /// `[d_text, d]`.
    text_weight: Param<Tensor<2>>,
    text_bias: Param<Tensor<1>>,
    blocks: Vec<Block>,
    norm: Param<Tensor<1>>,
    /// `[d, V_k]` each, from the second layer on; the last layer's alone where the others are tied to
    /// the embedding.
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

/// The second stage with what its forward pass needs beside its parameters.
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

    /// −ln p of each supervised code of each layer after the first, in nats.
    pub fn nll(&self, batch: &LayerBatch) -> Vec<Vec<f64>> {
        let x_nd = self.features(batch);
        heads_nll(self.backbone.kernels, &x_nd, &batch.targets, |later| self.head(later))
    }

    /// Logits over the codes of a layer, counted from 0, of the batch's rows for it, `[s, V_k]`.
    pub fn logits(&self, batch: &LayerBatch, layer: usize) -> Tensor<2> {
        let kernels = self.backbone.kernels;
        let x_sd = kernels.select_rows(self.features(batch), &batch.targets[layer - 1].rows);
        kernels.logits(x_sd, self.head(layer - 1), EPSILON)
    }

    /// What the blocks make of all rows, `[n, d]`.
    fn features(&self, batch: &LayerBatch) -> Tensor<2> {
        let ResidualTransformer { text_weight, text_bias, blocks, .. } = &self.weights;
        let text_nd = self.backbone.projected(batch.text.clone(), text_weight, text_bias);
        let rows = Tensor::cat(vec![text_nd, self.place_rows(batch)], 0);
        let x_nd = self.backbone.kernels.select_rows(rows, &batch.order);
        self.backbone.forward(blocks, x_nd, &batch.layout)
    }

    /// The sum of what the layers before add to each place, and the layer that is asked for, `[p, d]`.
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
