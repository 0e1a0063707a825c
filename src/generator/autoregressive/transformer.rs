//! The model: text prefix, blocks of attention and feed-forward, head over codes.
//!
//! Shapes: n rows of the batch, d width, f feed-forward width, V codes, s supervised rows.

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::generator::autoregressive::batch::Batch;
use crate::generator::stack::{Block, EPSILON, Stack, kernels_of, projected, single};
use crate::learn::params::{constant, normal};
use crate::ops::{HeadWeights, Kernels, Rope};
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
    blocks: Vec<Block>,
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
    shape: ModelShape,
    n_vocab: usize,
    rope: Arc<Rope>,
    kernels: Kernels,
    device: Device,
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
        let head_dim = shape.d_model / shape.n_head;
        let rope = Arc::new(Rope::new(shape.n_ctx, head_dim, shape.rope_base));
        Self { weights, shape: shape.clone(), n_vocab, rope, kernels, device: device.clone() }
    }

    /// The same model with its products computed in a precision.
    pub fn in_precision(self, precision: Precision) -> Self {
        Self { kernels: kernels_of(precision, &self.device), ..self }
    }

    /// The same model without gradients and in single precision, for evaluation.
    pub fn frozen(&self) -> Self {
        let kernels = single(self.kernels, &self.device);
        let (weights, device) = (self.weights.valid(), self.device.clone().inner());
        Self { weights, kernels, device, ..self.clone() }
    }

    /// Where the parameters live.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Mean cross-entropy over the batch's targets, in nats, `[1]`.
    pub fn loss(&self, batch: &Batch) -> Tensor<1> {
        self.kernels.head_loss(self.features(batch), self.head(), &batch.targets, EPSILON)
    }

    /// −ln p of each target of the batch, in nats.
    pub fn nll(&self, batch: &Batch) -> Vec<f64> {
        self.kernels.head_nll(self.features(batch), self.head(), &batch.targets, EPSILON)
    }

    /// Logits over codes and end, of the supervised rows only, `[s, V + 1]`.
    pub fn logits(&self, batch: &Batch) -> Tensor<2> {
        self.kernels.logits(self.features(batch), self.head(), EPSILON)
    }

    /// What the blocks make of the supervised rows, `[s, d]`.
    fn features(&self, batch: &Batch) -> Tensor<2> {
        let x_nd = self.stack().forward(self.embed(batch), &batch.layout);
        if batch.target_rows.len() == batch.layout.n_rows() {
            return x_nd;
        }
        self.kernels.select_rows(x_nd, &batch.target_rows)
    }

    fn head(&self) -> HeadWeights {
        let weight_dv = match &self.weights.head {
            Some(head) => head.val(),
            None => self.weights.embedding.val().narrow(0, 0, self.n_vocab + 1).transpose(),
        };
        HeadWeights { gamma_d: self.weights.norm.val(), weight_dv }
    }

    /// Projected text and embedded codes, in the batch's order, `[n, d]`.
    fn embed(&self, batch: &Batch) -> Tensor<2> {
        let text_nd = self.embed_text(batch.text.clone());
        if batch.codes.is_empty() {
            return self.kernels.select_rows(text_nd, &batch.order);
        }
        let codes_nd = self.embed_codes(&batch.codes);
        self.kernels.select_rows(Tensor::cat(vec![text_nd, codes_nd], 0), &batch.order)
    }

    /// Projected text vectors, `[n, d]`.
    pub(super) fn embed_text(&self, vectors: Vec<f32>) -> Tensor<2> {
        let Transformer { text_weight, text_bias, .. } = &self.weights;
        projected(vectors, text_weight, text_bias, &self.device)
    }

    /// Embedded codes, `[n, d]`.
    pub(super) fn embed_codes(&self, codes: &Arc<[u32]>) -> Tensor<2> {
        self.kernels.select_rows(self.weights.embedding.val(), codes)
    }

    /// Logits over codes and end for rows that the blocks are done with, `[n, V + 1]`.
    pub(super) fn head_logits(&self, x_nd: Tensor<2>) -> Tensor<2> {
        self.kernels.logits(x_nd, self.head(), EPSILON)
    }

    /// Its blocks, to be run over positions that come one after another.
    pub(super) fn stack(&self) -> Stack<'_> {
        Stack {
            blocks: &self.weights.blocks,
            shape: &self.shape,
            rope: &self.rope,
            kernels: self.kernels,
            device: &self.device,
        }
    }

    /// Rows of a matrix, in the order given.
    pub(super) fn rows(&self, x_nd: Tensor<2>, rows: &Arc<[u32]>) -> Tensor<2> {
        self.kernels.select_rows(x_nd, rows)
    }

    /// Its sizes.
    pub fn shape(&self) -> &ModelShape {
        &self.shape
    }
}
