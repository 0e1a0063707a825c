//! The model: text prefix, blocks of attention and feed-forward, head over codes.
//!
//! Shapes: n rows of the batch, d width, f feed-forward width, V codes, s supervised rows.

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::generator::Network;
use crate::generator::autoregressive::batch::Batch;
use crate::generator::stack::{Backbone, Block, EPSILON, kernels_of};
use crate::learn::params::{constant, normal};
use crate::ops::{HeadWeights, Kernels};
use crate::plan::RunSpec;
use crate::spec::{ModelShape, Precision};

/// The id of the end token, after the codes; the pad token is one more.
pub fn end_token(n_vocab: usize) -> u32 {
    n_vocab as u32
}

/// All parameters of the model.
#[derive(Module, Debug)]
pub struct Transformer {
    /// `[V + 2, d]`: codes, end, pad.
    embedding: Param<Tensor<2>>,
    /// `[d_text, d]`.
    text_weight: Param<Tensor<2>>,
    text_bias: Param<Tensor<1>>,
    pub(super) blocks: Vec<Block>,
    norm: Param<Tensor<1>>,
    /// `[d, V + 1]`: codes and end; absent where tied to the embedding.
    head: Option<Param<Tensor<2>>>,
}

impl Transformer {
    /// Draws parameters: N(0, 2/(5d)) (Nguyen and Salazar 2019), projections back into the residual
    /// stream smaller by √(2L), gains 1, bias 0. ScaMo's code defines an init and never applies it.
    pub fn init(shape: &ModelShape, n_vocab: usize, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let d = shape.d_model;
        let std = (2.0 / (5.0 * d as f64)).sqrt();
        let text_std = (2.0 / (5.0 * shape.d_text as f64)).sqrt();
        Self {
            embedding: normal([n_vocab + 2, d], std, rng, device),
            text_weight: normal([shape.d_text, d], text_std * std, rng, device),
            text_bias: constant([d], 0.0, device),
            blocks: (0..shape.n_layer).map(|_| Block::init(shape, std, rng, device)).collect(),
            norm: constant([d], 1.0, device),
            head: (!shape.tie_embeddings).then(|| normal([d, n_vocab + 1], std, rng, device)),
        }
    }
}

/// A transformer with what its forward pass needs beside its parameters.
#[derive(Clone, Debug)]
pub struct Model {
    pub weights: Transformer,
    pub(super) backbone: Backbone,
    n_vocab: usize,
}

impl Model {
    /// A model with drawn parameters; on an autodiff device it can be trained.
    pub fn init(shape: &ModelShape, n_vocab: usize, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let weights = Transformer::init(shape, n_vocab, rng, device);
        Self::new(weights, shape, n_vocab, Kernels::for_device(device), device)
    }

    /// A model of given parameters, computed by given kernels.
    pub fn new(
        weights: Transformer,
        shape: &ModelShape,
        n_vocab: usize,
        kernels: Kernels,
        device: &Device,
    ) -> Self {
        Self { weights, backbone: Backbone::new(shape, kernels, device), n_vocab }
    }

    /// The same model with its products computed in a precision.
    pub fn in_precision(mut self, precision: Precision) -> Self {
        self.backbone.kernels = kernels_of(precision, &self.backbone.device);
        self
    }

    /// The same model without gradients and in single precision, for evaluation.
    pub fn frozen(&self) -> Self {
        Self {
            weights: self.weights.valid(),
            backbone: self.backbone.frozen(),
            n_vocab: self.n_vocab,
        }
    }

    /// −ln p of each target of the batch, in nats.
    pub fn nll(&self, batch: &Batch) -> Vec<f64> {
        let kernels = self.backbone.kernels;
        kernels.head_nll(self.features(batch), self.head(), &batch.targets, EPSILON)
    }

    /// Logits over codes and end, of the supervised rows only, `[s, V + 1]`.
    pub fn logits(&self, batch: &Batch) -> Tensor<2> {
        self.head_logits(self.features(batch))
    }

    /// What the blocks make of the supervised rows, `[s, d]`.
    fn features(&self, batch: &Batch) -> Tensor<2> {
        let Backbone { kernels, .. } = self.backbone;
        let mut rows = vec![self.embed_text(batch.text.clone())];
        if !batch.codes.is_empty() {
            rows.push(self.embed_codes(&batch.codes));
        }
        let x_nd = kernels.select_rows(Tensor::cat(rows, 0), &batch.order);
        let x_nd = self.backbone.forward(&self.weights.blocks, x_nd, &batch.layout);
        if batch.target_rows.len() == batch.layout.n_rows() {
            return x_nd;
        }
        kernels.select_rows(x_nd, &batch.target_rows)
    }

    fn head(&self) -> HeadWeights {
        let weight_dv = match &self.weights.head {
            Some(head) => head.val(),
            None => self.weights.embedding.val().narrow(0, 0, self.n_vocab + 1).transpose(),
        };
        HeadWeights { gamma_d: self.weights.norm.val(), weight_dv }
    }

    /// Projected text vectors, `[n, d]`.
    pub(super) fn embed_text(&self, vectors: Vec<f32>) -> Tensor<2> {
        self.backbone.projected(vectors, &self.weights.text_weight, &self.weights.text_bias)
    }

    /// Embedded codes, `[n, d]`.
    pub(super) fn embed_codes(&self, codes: &Arc<[u32]>) -> Tensor<2> {
        self.backbone.looked_up(&self.weights.embedding, codes)
    }

    /// Logits over codes and end for rows that the blocks are done with, `[n, V + 1]`.
    pub(super) fn head_logits(&self, x_nd: Tensor<2>) -> Tensor<2> {
        self.backbone.kernels.logits(x_nd, self.head(), EPSILON)
    }

    /// Its sizes.
    pub fn shape(&self) -> &ModelShape {
        &self.backbone.shape
    }
}

impl Network for Model {
    type Weights = Transformer;
    type Batch = Batch;

    fn drawn(spec: &RunSpec, precision: Precision, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self::init(spec.shape(), spec.n_vocab(), rng, device).in_precision(precision)
    }

    fn weights(&self) -> &Transformer {
        &self.weights
    }

    fn set_weights(&mut self, weights: Transformer) {
        self.weights = weights;
    }

    fn loss(&self, batch: &Batch) -> Tensor<1> {
        let kernels = self.backbone.kernels;
        kernels.head_loss(self.features(batch), self.head(), &batch.targets, EPSILON)
    }
}
