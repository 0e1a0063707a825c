//! [`Tower`]: sequences of vectors into one unit vector each.
//!
//! Shapes: m rows of all sequences, n sequences, c channels, d width, e numbers of an embedding.

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::evaluator::rows::Rows;
use crate::generator::stack::{Backbone, Block, EPSILON};
use crate::learn::params::{constant, normal};
use crate::ops::{HeadWeights, Kernels, Rope};
use crate::spec::{EvaluatorSpec, Ffn, ModelShape, MotionClipSpec};

/// The parameters of a tower: a row that sums up stands before each sequence, and every row sees every
/// other.
#[derive(Module, Debug)]
pub struct Tower {
    /// `[c, d]`.
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
    /// `[1, d]`.
    summary: Param<Tensor<2>>,
    blocks: Vec<Block>,
    norm: Param<Tensor<1>>,
    /// `[d, e]`.
    head: Param<Tensor<2>>,
    #[module(skip)]
    shape: ModelShape,
    #[module(skip)]
    rope: Arc<Rope>,
}

impl Tower {
    /// Draws parameters as those of a generator's transformer are drawn.
    pub fn init(
        spec: &EvaluatorSpec,
        sizes: &MotionClipSpec,
        channels: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let (d, shape) = (sizes.width, shape(spec, sizes));
        let std = (2.0 / (5.0 * d as f64)).sqrt();
        Self {
            weight: normal([channels, d], (channels as f64).sqrt().recip(), rng, device),
            bias: constant([d], 0.0, device),
            summary: normal([1, d], 1.0, rng, device),
            blocks: (0..sizes.layers).map(|_| Block::init(&shape, std, rng, device)).collect(),
            norm: constant([d], 1.0, device),
            head: normal([d, spec.dim], (d as f64).sqrt().recip(), rng, device),
            rope: Arc::new(Rope::new(shape.n_ctx, d / sizes.heads, shape.rope_base)),
            shape,
        }
    }

    /// A unit vector of each sequence, `[n, e]`.
    pub fn embed(&self, rows: &Rows) -> Tensor<2> {
        let (device, shape, rope) = (self.weight.device(), self.shape.clone(), self.rope.clone());
        let kernels = Kernels::for_device(&device);
        let backbone = Backbone { shape, rope, kernels, device };
        let vectors_md = backbone.projected(rows.values.clone(), &self.weight, &self.bias);
        let summary = vectors_md.dims()[0] as u32;
        let all = Tensor::cat(vec![vectors_md, self.summary.val()], 0);
        let x_md = kernels.select_rows(all, &rows.order(summary));
        let x_md = backbone.forward(&self.blocks, x_md, &rows.summarised());
        let x_nd = kernels.select_rows(x_md, &rows.summaries());
        let head = HeadWeights { gamma_d: self.norm.val(), weight_dv: self.head.val() };
        unit(kernels.logits(x_nd, head, EPSILON))
    }
}

/// x / |x|, row by row.
fn unit(x_ne: Tensor<2>) -> Tensor<2> {
    let square_n1 = x_ne.clone().powi_scalar(2).sum_dim(1);
    x_ne.div(square_n1.add_scalar(1e-12).sqrt())
}

/// The sizes of the blocks of both towers; what only models of codes have is left at nothing.
fn shape(spec: &EvaluatorSpec, sizes: &MotionClipSpec) -> ModelShape {
    let longest = spec.max_words.max(spec.window / sizes.frames);
    ModelShape {
        n_layer: sizes.layers,
        n_head: sizes.heads,
        d_model: sizes.width,
        d_ff: 8 * sizes.width / 3,
        n_ctx: longest + 1,
        d_text: 0,
        ffn: Ffn::SwiGlu,
        tie_embeddings: false,
        rope_base: 10_000.0,
    }
}
