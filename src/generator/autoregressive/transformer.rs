//! The model: text prefix, blocks of attention and feed-forward, head over codes.
//!
//! Shapes: n rows of the batch, d width, f feed-forward width, V codes, s supervised rows.

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use crate::generator::autoregressive::batch::Batch;
use crate::learn::params::{constant, normal};
use crate::ops::{
    Activation, AttentionOptions, AttentionWeights, FeedForwardWeights, HalfFloat, HeadWeights,
    Joining, Kernels, KeyValues, Rope,
};
use crate::spec::ModelShape;
use crate::spec::{Ffn, Precision};

/// RMSNorm's ε, as in LLaMA.
const EPSILON: f32 = 1e-5;

/// The id of the end token, after the codes; the pad token is one more.
pub fn end_token(n_vocab: usize) -> u32 {
    n_vocab as u32
}

/// The parameters of a pre-norm transformer block.
///
/// x ← x + Attention(RMSNorm(x)) W_o, x ← x + FFN(RMSNorm(x)); no biases (ScaMo §3.1, LLaMA).
#[derive(Module, Debug)]
pub struct Block {
    norm_attention: Param<Tensor<1>>,
    /// `[d, 3d]`: queries, keys, values.
    qkv: Param<Tensor<2>>,
    /// `[d, d]`.
    output: Param<Tensor<2>>,
    norm_ffn: Param<Tensor<1>>,
    /// `[d, 2f]` (gate and up) with SwiGLU, `[d, f]` with GELU.
    up: Param<Tensor<2>>,
    /// `[f, d]`.
    down: Param<Tensor<2>>,
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

impl Block {
    fn init(shape: &ModelShape, std: f64, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let (d, f) = (shape.d_model, shape.d_ff);
        let residual_std = std / (2.0 * shape.n_layer as f64).sqrt();
        let up = match shape.ffn {
            Ffn::SwiGlu => 2 * f,
            Ffn::Gelu => f,
        };
        Self {
            norm_attention: constant([d], 1.0, device),
            qkv: normal([d, 3 * d], std, rng, device),
            output: normal([d, d], residual_std, rng, device),
            norm_ffn: constant([d], 1.0, device),
            up: normal([d, up], std, rng, device),
            down: normal([f, d], residual_std * (d as f64 / f as f64).sqrt(), rng, device),
        }
    }
}

impl Block {
    fn attention(&self) -> AttentionWeights {
        AttentionWeights {
            gamma_d: self.norm_attention.val(),
            qkv_d3d: self.qkv.val(),
            output_dd: self.output.val(),
        }
    }

    fn feed_forward(&self) -> FeedForwardWeights {
        FeedForwardWeights {
            gamma_d: self.norm_ffn.val(),
            up_du: self.up.val(),
            down_fd: self.down.val(),
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
        let kernels = match precision {
            Precision::F32 => Kernels::for_device(&self.device),
            Precision::F16 => Kernels::Half(HalfFloat::F16),
            Precision::Bf16 => Kernels::Half(HalfFloat::Bf16),
        };
        Self { kernels, ..self }
    }

    /// The same model without gradients and in single precision, for evaluation.
    pub fn frozen(&self) -> Self {
        let kernels = match self.kernels {
            Kernels::Half(_) => Kernels::for_device(&self.device),
            single => single,
        };
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
        let rope = self.rope.clone();
        let layout = batch.layout.clone();
        let options =
            AttentionOptions { n_head: self.shape.n_head, layout, rope, epsilon: EPSILON };
        let mut x_nd = self.embed(batch);
        for block in &self.weights.blocks {
            x_nd = self.block(block, x_nd, &options);
        }
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
        let n_text = vectors.len() / self.shape.d_text;
        let text = TensorData::new(vectors, [n_text, self.shape.d_text]);
        let text = Tensor::<2>::from_data(text, &self.device);
        let bias_1d = self.weights.text_bias.val().unsqueeze::<2>();
        text.matmul(self.weights.text_weight.val()) + bias_1d
    }

    /// Embedded codes, `[n, d]`.
    pub(super) fn embed_codes(&self, codes: &Arc<[u32]>) -> Tensor<2> {
        self.kernels.select_rows(self.weights.embedding.val(), codes)
    }

    fn block(&self, block: &Block, x_nd: Tensor<2>, options: &AttentionOptions) -> Tensor<2> {
        let x_nd = self.kernels.attention(x_nd, block.attention(), options);
        self.feed_forward(block, x_nd)
    }

    /// What the blocks make of positions that join their sequences, `[n, d]`; `kept` has one entry a
    /// block.
    pub(super) fn join(
        &self,
        x_nd: Tensor<2>,
        joining: &Joining,
        kept: &mut [KeyValues],
    ) -> Tensor<2> {
        self.weights.blocks.iter().zip(kept).fold(x_nd, |x_nd, (block, kept)| {
            let x_nd = joining.attention(x_nd, block.attention(), kept, EPSILON);
            self.feed_forward(block, x_nd)
        })
    }

    /// Logits over codes and end for rows of [`Model::join`], `[n, V + 1]`.
    pub(super) fn head_logits(&self, x_nd: Tensor<2>) -> Tensor<2> {
        self.kernels.logits(x_nd, self.head(), EPSILON)
    }

    /// Rows of a matrix, in the order given.
    pub(super) fn rows(&self, x_nd: Tensor<2>, rows: &Arc<[u32]>) -> Tensor<2> {
        self.kernels.select_rows(x_nd, rows)
    }

    /// Its sizes.
    pub(super) fn shape(&self) -> &ModelShape {
        &self.shape
    }

    /// The angles of its positions.
    pub(super) fn rope(&self) -> &Rope {
        &self.rope
    }

    fn feed_forward(&self, block: &Block, x_nd: Tensor<2>) -> Tensor<2> {
        let activation = match self.shape.ffn {
            Ffn::SwiGlu => Activation::SwiGlu,
            Ffn::Gelu => Activation::Gelu,
        };
        self.kernels.feed_forward(x_nd, block.feed_forward(), activation, EPSILON)
    }
}
