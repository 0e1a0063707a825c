//! The model: text prefix, blocks of attention and feed-forward, head over codes.
//!
//! Shapes: n rows of the batch, d width, f feed-forward width, V codes, s supervised rows.

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use crate::generator::Network;
use crate::generator::stack::{Backbone, Block, EPSILON, Growing, kernels_of, packed, padded};
use crate::learn::params::{constant, normal};
use crate::ops::{HeadWeights, Kernels, RowLosses, SequenceLayout};
use crate::spec::{ModelShape, Precision, RunSpec};

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
    /// `[d, V + 1]`: codes and end; absent if tied to the embedding.
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

/// A transformer with the non-trained inputs of its forward pass.
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

    /// −ln p of each target of the batch, in nats, and the likeliest id in its place.
    pub fn nll(&self, batch: &Batch) -> RowLosses {
        let kernels = self.backbone.kernels;
        kernels.head_nll(self.features(batch), self.head(), &batch.targets, EPSILON)
    }

    /// Logits over codes and end, of the supervised rows only, `[s, V + 1]`.
    pub fn logits(&self, batch: &Batch) -> Tensor<2> {
        self.head_logits(self.features(batch))
    }

    /// The output of the blocks for the supervised rows, `[s, d]`.
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

// [`Batch`]: sequences packed row after row, without padding.

/// One text prefix and the codes after it, of which a range is supervised.
#[derive(Clone, Copy, Debug)]
pub struct Sequence<'a> {
    /// Frozen text vectors, `[n_text, d_text]` row-major, at least one row.
    pub text: &'a [f32],
    /// The clip's codes, without the end token.
    pub codes: &'a [u32],
    /// First supervised target; target i is code i, and the last one is the end token.
    pub from: usize,
    /// One past the last supervised target, at most `codes.len() + 1`, or `codes.len()` where clips have
    /// no end token.
    pub to: usize,
}

/// A batch as the model takes it.
///
/// Sequence i takes rows `[text | codes]`: its last text row predicts its first code, each code's
/// row the next code, the last code's row the end token. Rows after the last supervised target are
/// left out, since nothing supervised depends on them.
#[derive(Clone, Debug)]
pub struct Batch {
    pub layout: Arc<SequenceLayout>,
    /// `[n_text_rows, d_text]`, all prefixes after one another.
    pub text: Vec<f32>,
    /// Codes of all motion rows.
    pub codes: Arc<[u32]>,
    /// The source of each row of the batch: a text row, or `n_text_rows` + a code.
    pub order: Arc<[u32]>,
    /// Rows that predict a supervised target.
    pub target_rows: Arc<[u32]>,
    /// Their targets, in `0..=V`.
    pub targets: Arc<[u32]>,
}

impl Batch {
    /// Packs sequences; `end` is the id of the end token, V.
    pub fn pack(sequences: &[Sequence], d_text: usize, end: u32) -> Self {
        let size = |sequence: &Sequence| [sequence.text.len() / d_text, sequence.to - 1];
        let sizes: Vec<[usize; 2]> = sequences.iter().map(size).collect();
        let (mut target_rows, mut targets, mut start) = (Vec::new(), Vec::new(), 0);
        for (sequence, [prefix, n_codes]) in sequences.iter().zip(&sizes) {
            for target in sequence.from..sequence.to {
                target_rows.push((start + prefix - 1 + target) as u32);
                targets.push(sequence.codes.get(target).copied().unwrap_or(end));
            }
            start += prefix + n_codes;
        }
        let (order, lengths) = packed(&sizes);
        let prefixes: Vec<usize> = sizes.iter().map(|own| own[0]).collect();
        let layout = SequenceLayout::new(&lengths, &prefixes).expect("prefixes are not empty");
        Self {
            layout: Arc::new(layout),
            text: sequences.iter().map(|own| own.text).collect::<Vec<_>>().concat(),
            codes: sequences.iter().flat_map(|own| &own.codes[..own.to - 1]).copied().collect(),
            order,
            target_rows: target_rows.into(),
            targets: targets.into(),
        }
    }
}

// [`Decoder`]: sequences that grow by one code at a time.
//
// Each position is rotated by its index in its own sequence, so the logits equal those of a whole pass over
// `[text | codes]`.
//
// Shapes: b sequences, p positions of the longest text.

/// Sequences that grow side by side.
pub struct Decoder<'a> {
    model: &'a Model,
    growing: Growing<'a>,
    /// Codes of each sequence so far.
    n_codes: usize,
}

impl<'a> Decoder<'a> {
    /// Sequences of text alone, `[n_text, d_text]` each, at least one row; and the logits of their
    /// first codes, `[b, V + 1]`.
    pub fn new(model: &'a Model, texts: &[&[f32]]) -> (Self, Tensor<2>) {
        let (backbone, d_text) = (&model.backbone, model.shape().d_text);
        let prefixes: Vec<usize> = texts.iter().map(|text| text.len() / d_text).collect();
        let mut growing = Growing::new(backbone, &model.weights.blocks, prefixes);
        let (b, p) = (texts.len(), growing.longest_text());
        let x_nd = model.embed_text(padded(texts, p * d_text));
        let angles: Vec<usize> = (0..b).flat_map(|_| 0..p).collect();
        let x_nd = growing.text(x_nd, &angles);
        let last = growing.prefixes().iter().enumerate().map(|(i, n)| (i * p + n - 1) as u32);
        let logits = model.head_logits(backbone.kernels.select_rows(x_nd, &Arc::from_iter(last)));
        (Self { model, growing, n_codes: 0 }, logits)
    }

    /// Appends a code to each sequence; returns the next logits, `[b, V + 1]`. A finished sequence continues, ignored, and
    /// may exceed the context.
    pub fn push(&mut self, codes: &Arc<[u32]>) -> Tensor<2> {
        let last = self.model.shape().n_ctx - 1;
        let angle = |prefix: &usize| (prefix + self.n_codes).min(last);
        let angles: Vec<usize> = self.growing.prefixes().iter().map(angle).collect();
        self.n_codes += 1;
        let x_bd = self.growing.join(self.model.embed_codes(codes), &angles);
        self.model.head_logits(x_bd)
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;
    use crate::spec::Ffn;

    #[test]
    fn rows_and_targets_of_two_sequences() {
        let whole = Sequence { text: &[1.0, 2.0], codes: &[5, 6], from: 0, to: 3 };
        let part = Sequence { text: &[3.0], codes: &[7, 8, 9], from: 1, to: 2 };
        let batch = Batch::pack(&[whole, part], 1, 99);
        assert_eq!(batch.text, [1.0, 2.0, 3.0]);
        assert_eq!(*batch.codes, [5, 6, 7]);
        assert_eq!(*batch.order, [0, 1, 3, 4, 2, 5]);
        assert_eq!(*batch.target_rows, [1, 2, 3, 5]);
        assert_eq!(*batch.targets, [5, 6, 99, 8]);
        assert_eq!((batch.layout.n_rows(), batch.layout.n_sequences()), (6, 2));
    }

    const CODES: [[u32; 4]; 2] = [[3, 1, 4, 1], [0, 5, 2, 5]];

    fn model(device: &Device) -> Model {
        let shape = ModelShape {
            n_layer: 2,
            n_head: 2,
            d_model: 12,
            d_ff: 16,
            n_ctx: 12,
            d_text: 3,
            ffn: Ffn::SwiGlu,
            tie_embeddings: false,
            rope_base: 10_000.0,
        };
        let model = Model::init(&shape, 6, &mut ChaCha8Rng::seed_from_u64(4), device);
        Model::new(model.weights, &shape, 6, Kernels::for_device(device), device)
    }

    fn texts() -> [Vec<f32>; 2] {
        [5, 2].map(|n| (0..3 * n).map(|i| (i as f32 * 1.7 + n as f32).sin()).collect())
    }

    /// The logits of the last `n + 1` targets after a text and codes, in one pass.
    fn whole(model: &Model, text: &[f32], codes: &[u32]) -> Vec<f32> {
        let sequence = Sequence { text, codes, from: codes.len(), to: codes.len() + 1 };
        let logits = model.logits(&Batch::pack(&[sequence], 3, 6));
        logits.into_data().try_into_vec().unwrap()
    }

    #[test]
    fn logits_are_those_of_a_whole_pass_whatever_stands_beside_a_sequence() {
        let device = Device::flex();
        let (model, texts) = (model(&device), texts());
        let refs: Vec<&[f32]> = texts.iter().map(Vec::as_slice).collect();
        let (mut decoder, mut logits) = Decoder::new(&model, &refs);
        for step in 0..=4 {
            let found: Vec<f32> = logits.clone().into_data().try_into_vec().unwrap();
            for (i, text) in texts.iter().enumerate() {
                let expected = whole(&model, text, &CODES[i][..step]);
                let own = &found[i * 7..][..7];
                let off = own.iter().zip(&expected).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f32::max) < 1e-5, "{step} {i}: {own:?} {expected:?}");
            }
            if step < 4 {
                logits = decoder.push(&CODES.map(|codes| codes[step]).into());
            }
        }
    }
}
