//! The model: text and length in front, blocks over scales, a head a scale.
//!
//! Shapes: n rows of the batch, d width, c channels of a latent, V_k codes of scale k.

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::batch::{Batch, Places};
use crate::codes::Grid;
use crate::generator::Network;
use crate::generator::stack::{Backbone, Block, EPSILON, heads_loss, heads_nll, kernels_of};
use crate::learn::params::{constant, normal};
use crate::ops::{HeadWeights, RowLosses};
use crate::spec::{GeneratorSpec, Precision, RunSpec, ScalewiseSpec};

/// All parameters of the model.
#[derive(Module, Debug)]
pub struct ScalewiseTransformer {
    /// `[d_text, d]`.
    text_weight: Param<Tensor<2>>,
    text_bias: Param<Tensor<1>>,
    /// The rows of the first scale, by slot, `[s_1, d]`.
    starts: Param<Tensor<2>>,
    /// Added to text and first scale, by the clip's strides less one, `[most_latents, d]`.
    lengths: Param<Tensor<2>>,
    /// Added to the rows of each scale, `[K, d]`.
    levels: Param<Tensor<2>>,
    /// `[c, d]`: projects the earlier scales' contribution to the latents.
    input_weight: Param<Tensor<2>>,
    input_bias: Param<Tensor<1>>,
    pub(super) blocks: Vec<Block>,
    norm: Param<Tensor<1>>,
    /// `[d, V_k]` each.
    heads: Vec<Param<Tensor<2>>>,
}

impl ScalewiseTransformer {
    /// Draws parameters as the autoregressive transformer does: N(0, 2/(5d)), biases 0.
    pub fn init(spec: &ScalewiseSpec, codes: &Grid, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let shape = &spec.shape;
        let d = shape.d_model;
        let from = |n: usize| (2.0 / (5.0 * n as f64)).sqrt();
        let std = from(d);
        let first = spec.longest(codes)[0];
        let input_std = from(spec.d_latent);
        Self {
            text_weight: normal([shape.d_text, d], from(shape.d_text) * std, rng, device),
            text_bias: constant([d], 0.0, device),
            starts: normal([first, d], std, rng, device),
            lengths: normal([spec.most_latents, d], std, rng, device),
            levels: normal([codes.scales.len(), d], std, rng, device),
            input_weight: normal([spec.d_latent, d], input_std, rng, device),
            input_bias: constant([d], 0.0, device),
            blocks: (0..shape.n_layer).map(|_| Block::init(shape, std, rng, device)).collect(),
            norm: constant([d], 1.0, device),
            heads: codes.scales.iter().map(|s| normal([d, s.n_vocab], std, rng, device)).collect(),
        }
    }
}

/// The model with the non-trained inputs of its forward pass.
#[derive(Clone, Debug)]
pub struct Model {
    pub weights: ScalewiseTransformer,
    pub(super) backbone: Backbone,
    spec: ScalewiseSpec,
    places: Places,
}

impl Model {
    /// A model with drawn parameters; on an autodiff device it can be trained.
    pub fn init(
        spec: &ScalewiseSpec,
        codes: &Grid,
        precision: Precision,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let weights = ScalewiseTransformer::init(spec, codes, rng, device);
        let places = Places::new(spec, codes);
        let backbone = Backbone::new(&spec.shape, kernels_of(precision, device), device);
        let backbone = Backbone { rope: places.rope.clone(), ..backbone };
        Self { weights, backbone, spec: spec.clone(), places }
    }

    /// The same model without gradients and in single precision, for evaluation.
    pub fn frozen(&self) -> Self {
        let (weights, backbone) = (self.weights.valid(), self.backbone.frozen());
        Self { weights, backbone, spec: self.spec.clone(), places: self.places.clone() }
    }

    /// Its sizes.
    pub fn spec(&self) -> &ScalewiseSpec {
        &self.spec
    }

    /// The times of its rows.
    pub fn places(&self) -> &Places {
        &self.places
    }

    /// −ln p of each supervised code of each scale, in nats, and the likeliest code in its place.
    pub fn nll(&self, batch: &Batch) -> Vec<RowLosses> {
        let x_nd = self.features(batch);
        heads_nll(self.backbone.kernels, &x_nd, &batch.targets, |scale| self.head(scale))
    }

    /// Logits over the codes of a scale for rows of the blocks' output, `[n, V_k]`.
    pub fn logits(&self, scale: usize, x_nd: Tensor<2>) -> Tensor<2> {
        self.backbone.kernels.logits(x_nd, self.head(scale), EPSILON)
    }

    /// The output of the blocks for all rows, `[n, d]`.
    pub fn features(&self, batch: &Batch) -> Tensor<2> {
        let text_nd = self.text_rows(batch.text.clone(), &batch.text_lengths);
        let starts_nd = self.start_rows(&batch.starts, &batch.start_lengths);
        let mut rows = vec![text_nd, starts_nd];
        if !batch.levels.is_empty() {
            rows.push(self.input_rows(batch.inputs.clone(), &batch.levels));
        }
        let x_nd = self.backbone.kernels.select_rows(Tensor::cat(rows, 0), &batch.order);
        self.backbone.forward(&self.weights.blocks, x_nd, &batch.layout)
    }

    /// Projected text vectors with the lengths of their clips, `[n, d]`.
    pub fn text_rows(&self, vectors: Vec<f32>, lengths: &Arc<[u32]>) -> Tensor<2> {
        let ScalewiseTransformer { text_weight, text_bias, .. } = &self.weights;
        self.backbone.projected(vectors, text_weight, text_bias) + self.lengths(lengths)
    }

    /// The rows of the first scale, `[n, d]`.
    pub fn start_rows(&self, slots: &Arc<[u32]>, lengths: &Arc<[u32]>) -> Tensor<2> {
        let starts_nd = self.backbone.looked_up(&self.weights.starts, slots);
        let first: Arc<[u32]> = vec![0; slots.len()].into();
        starts_nd + self.lengths(lengths) + self.levels(&first)
    }

    /// The rows of later scales, `[n, d]`.
    pub fn input_rows(&self, inputs: Vec<f32>, levels: &Arc<[u32]>) -> Tensor<2> {
        let ScalewiseTransformer { input_weight, input_bias, .. } = &self.weights;
        self.backbone.projected(inputs, input_weight, input_bias) + self.levels(levels)
    }

    fn lengths(&self, strides: &Arc<[u32]>) -> Tensor<2> {
        let last = self.spec.most_latents as u32;
        let rows: Arc<[u32]> = strides.iter().map(|&n| n.clamp(1, last) - 1).collect();
        self.backbone.looked_up(&self.weights.lengths, &rows)
    }

    fn levels(&self, scales: &Arc<[u32]>) -> Tensor<2> {
        self.backbone.looked_up(&self.weights.levels, scales)
    }

    fn head(&self, scale: usize) -> HeadWeights {
        let weight_dv = self.weights.heads[scale].val();
        HeadWeights { gamma_d: self.weights.norm.val(), weight_dv }
    }
}

impl Network for Model {
    type Weights = ScalewiseTransformer;
    type Batch = Batch;

    fn drawn(spec: &RunSpec, precision: Precision, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self::init(own(spec), &spec.codes, precision, rng, device)
    }

    fn weights(&self) -> &ScalewiseTransformer {
        &self.weights
    }

    fn set_weights(&mut self, weights: ScalewiseTransformer) {
        self.weights = weights;
    }

    fn loss(&self, batch: &Batch) -> Tensor<1> {
        let x_nd = self.features(batch);
        heads_loss(self.backbone.kernels, &x_nd, &batch.targets, |scale| self.head(scale))
    }
}

/// The description of a run's generator, which is of this kind.
pub fn own(spec: &RunSpec) -> &ScalewiseSpec {
    match &spec.generator {
        GeneratorSpec::Scalewise(own) => own,
        other => unreachable!("a {} generator", other.name()),
    }
}
