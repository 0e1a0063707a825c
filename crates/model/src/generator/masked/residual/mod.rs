//! MoMask's second stage, for codes of several layers: predicts all codes of a layer from the text and the codes of
//! earlier layers.
//!
//! The input of a position is the sum of the embeddings of its codes in earlier layers, and a learned vector of the
//! predicted layer. Every position of `[text | positions]` attends to every other. The network has the shape of the
//! first stage, but no shared parameters. MoMask gives the layer as a separate position, and ties its heads to the
//! embeddings; here each layer has its own head, like the scales of the scale-by-scale transformer, unless
//! `model.tie_embeddings` is set.

mod model;

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::MaskedSampler;
use super::hidden::{Hidden, Shown, bound, drawn_layer, forward_flops, hidden_clip, pack};
use crate::codes::Grid;
use crate::data::Split;
use crate::generator::autoregressive::{Batch, Model, Part, TokenStream, Transformer};
use crate::generator::kind::step_rng;
use crate::generator::losses::{SplitSums, passes};
use crate::generator::probed::{MOST_TOKENS, made_up_clip};
use crate::generator::{Inputs, Kind, Network, Objective, Sampler, SplitLoss};
use crate::progress::moved;
use crate::spec::flops::exact_whole;
use crate::spec::{ModelShape, Precision, RunSpec};

pub use model::{Asked, LayerBatch, ResidualModel, ResidualTransformer};

/// Both masked transformers, for codes of several layers, as a kind of generator.
pub struct MaskedResidual;

impl Kind for MaskedResidual {
    type Network = Stages;
    type Objective<'a> = TwoStages<'a>;

    fn sampler(spec: &RunSpec, stages: Stages) -> Box<dyn Sampler> {
        Box::new(MaskedSampler::new(spec, stages.base, Some(stages.residual)))
    }

    /// Layers are asked for as often as they are drawn.
    fn made_up(spec: &RunSpec, _: &Stages) -> (StageBatches, usize) {
        let (shape, scales) = (spec.shape(), &spec.codes.scales);
        let fewest = scales.iter().map(|scale| scale.n_vocab).min().unwrap_or(1);
        let (text, codes) = made_up_clip(shape, fewest);
        let n_places = codes.len();
        let n_clips = spec.batch_tokens.min(MOST_TOKENS).div_ceil(2 * n_places);
        let hidden = vec![hidden_clip(&text, &codes, scales[0].n_vocab); n_clips];
        let all = codes.repeat(scales.len());
        let asked = (0..n_clips).map(|clip| {
            let layer = drawn_layer(scales.len(), (clip as f64 + 0.5) / n_clips as f64);
            Asked::of_clip(&text, &all, scales.len(), layer, 0..n_places)
        });
        let asked: Vec<Asked> = asked.collect();
        let base = Some(pack(&hidden, shape.d_text));
        let later = Some(LayerBatch::pack(&asked, &spec.codes, shape.d_text));
        (StageBatches { base, later }, 2 * n_clips * n_places)
    }
}

// [`TwoStages`]: the batches of a run of both stages.

/// The cross-entropy of hidden codes of the first layer, and of the codes of the others.
///
/// Both stages train together on the same clips. A position is two tokens: its code of the first layer, hidden or not,
/// and its code of the layer drawn for the clip. A step takes the next `batch_tokens` of them; if that is odd, a
/// position's two tokens are split over two steps.
pub struct TwoStages<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    stream: TokenStream<'a>,
    shown: Shown<'a>,
}

impl TwoStages<'_> {
    /// The places of a step for each stage. Token t belongs to place t / 2: the even ones to the first
    /// stage, the odd ones to the second.
    fn parts(&mut self, step: usize) -> [Vec<Part>; 2] {
        let (from, to) = (step * self.spec.batch_tokens, (step + 1) * self.spec.batch_tokens);
        let first = self.stream.parts(from.div_ceil(2), to.div_ceil(2) - from.div_ceil(2));
        [first, self.stream.parts(from / 2, to / 2 - from / 2)]
    }
}

impl<'a> Objective<'a> for TwoStages<'a> {
    type Network = Stages;

    fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self {
        let stream = TokenStream::of_places(inputs.tokens, inputs.text, spec.seed);
        let stream = stream.over(spec.share).showing(spec.captions);
        Self { spec, inputs, stream, shown: Shown::new(spec, inputs) }
    }

    fn batch(&mut self, _: &Stages, step: usize) -> (StageBatches, f64) {
        let [first, later] = self.parts(step);
        let (spec, d_text) = (self.spec, self.inputs.text.dim());
        let mut rng = step_rng(spec, step);
        let hidden: Vec<Hidden> =
            first.iter().map(|part| self.shown.hidden(part, &mut rng)).collect();
        let asked: Vec<Asked> = later.iter().map(|part| self.shown.asked(part, &mut rng)).collect();
        let base = (!hidden.is_empty()).then(|| pack(&hidden, d_text));
        let later = (!asked.is_empty()).then(|| LayerBatch::pack(&asked, &spec.codes, d_text));
        let n_vocab = spec.codes.scales[0].n_vocab;
        let of_base = |batch| forward_flops(spec.shape(), n_vocab, &hidden, batch);
        let of_later = |batch| flops_of_layers(spec, batch);
        let flops = base.as_ref().map_or(0.0, of_base) + later.as_ref().map_or(0.0, of_later);
        (StageBatches { base, later }, flops)
    }

    fn split_loss(&self, stages: &Stages, split: Split) -> SplitLoss {
        let mut sums = SplitSums::by_scale(self.inputs.tokens, split);
        bound(&stages.base.frozen(), self.inputs, &mut sums);
        later_layers(&stages.residual.frozen(), &self.spec.codes, self.inputs, &mut sums);
        sums.loss()
    }

    /// For the largest layer: a uniform guess is no worse on others.
    fn uniform_nats(&self) -> f64 {
        let largest = self.spec.codes.scales.iter().map(|scale| scale.n_vocab).max();
        ((largest.unwrap_or(1) + 1) as f64).ln()
    }
}

/// Multiply-adds of a batch of the second stage, times two: each clip at its own length, the heads per
/// target.
fn flops_of_layers(spec: &RunSpec, batch: &LayerBatch) -> f64 {
    let (shape, layout): (&ModelShape, _) = (spec.shape(), &batch.layout);
    let blocks = batch.n_places.iter().enumerate();
    let blocks = blocks.map(|(i, &n)| exact_whole(shape, 0, layout.len(i) - n, n, 0));
    let heads = spec.codes.scales[1..].iter().zip(&batch.targets);
    let heads = heads.map(|(scale, own)| own.codes.len() * shape.d_model * scale.n_vocab);
    blocks.sum::<f64>() + 2.0 * heads.sum::<usize>() as f64
}

// [`Stages`]: both stages as one model.

/// The parameters of both stages, which share none.
#[derive(Module, Debug)]
pub struct StageWeights {
    base: Transformer,
    residual: ResidualTransformer,
}

/// The input of each stage in a step, if any.
pub struct StageBatches {
    pub base: Option<Batch>,
    pub later: Option<LayerBatch>,
}

/// The stage that makes the codes of the first layer, and the one that makes all others.
#[derive(Clone, Debug)]
pub struct Stages {
    pub base: Model,
    pub residual: ResidualModel,
    /// The parameters of `base` and `residual`.
    weights: StageWeights,
    n_layers: usize,
}

impl Stages {
    /// Stages of one shape with drawn parameters; on an autodiff device they can be trained.
    pub fn init(
        shape: &ModelShape,
        grid: &Grid,
        precision: Precision,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let base = Model::init(shape, grid.scales[0].n_vocab, rng, device).in_precision(precision);
        let residual = ResidualModel::init(shape, grid, precision, rng, device);
        let weights =
            StageWeights { base: base.weights.clone(), residual: residual.weights.clone() };
        Self { base, residual, weights, n_layers: grid.scales.len() }
    }
}

impl Network for Stages {
    type Weights = StageWeights;
    type Batch = StageBatches;

    fn drawn(spec: &RunSpec, precision: Precision, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self::init(spec.shape(), &spec.codes, precision, rng, device)
    }

    fn weights(&self) -> &StageWeights {
        &self.weights
    }

    fn set_weights(&mut self, weights: StageWeights) {
        self.base.weights = weights.base.clone();
        self.residual.weights = weights.residual.clone();
        self.weights = weights;
    }

    /// The loss of a step, in nats per code, `[1]`: (1/K) of the mean over the hidden codes of the first layer plus
    /// (K − 1)/K of the mean over the targets of the second stage.
    ///
    /// With uniformly drawn layers this would be the mean nats per code of all layers, up to the weighting of the first by
    /// `HiddenCodes`; as drawn, each layer has the weight of its probability. The stages share no parameter, so their
    /// relative weight matters only for gradient clipping. A step with codes of only one stage has that one's mean.
    fn loss(&self, batches: &StageBatches) -> Tensor<1> {
        let first = batches.base.as_ref().map(|batch| self.base.loss(batch));
        let later = batches.later.as_ref().map(|batch| self.residual.loss(batch));
        let share = 1.0 / self.n_layers as f64;
        match (first, later) {
            (Some(first), Some(later)) => first * share + later * (1.0 - share),
            (first, later) => first.or(later).expect("a step supervises something"),
        }
    }
}

// The loss on a split, by layer and as a whole.
//
// For the first layer a bound is measured, for each later one the likelihood given earlier layers: their sum is a bound
// on the nats of all codes.

/// Takes in −ln p of the codes of each layer after the first.
fn later_layers(model: &ResidualModel, grid: &Grid, inputs: &Inputs, sums: &mut SplitSums) {
    let (tokens, split, n_layers) = (inputs.tokens, sums.split, grid.scales.len());
    for clips in passes(tokens, split) {
        let every_layer = |clip: usize| {
            let (text, codes) = (inputs.text.shown(split, clip), tokens.clip(split, clip));
            let places = 0..codes.len() / n_layers;
            (1..n_layers)
                .map(move |layer| Asked::of_clip(text, codes, n_layers, layer, places.clone()))
        };
        let asked: Vec<Asked> = clips.clone().flat_map(every_layer).collect();
        let batch = LayerBatch::pack(&asked, grid, inputs.text.dim());
        sums.add_scales(1, (&model.nll(&batch), &batch.targets), &clips);
        moved();
    }
}
