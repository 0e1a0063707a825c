//! Residual finite scalar quantization: the digits of a bounded latent, layer after layer.
//!
//! A latent is projected to one number z per dimension and bounded once, softly: x = tanh z. Layer i
//! (from 0) rounds what the layers before it leave over, r, to the middle of one of L equal parts of
//! the interval that it can lie in, [−L⁻ⁱ, L⁻ⁱ]:
//!
//! digit = ⌊(r·Lⁱ + 1)/2 · L⌋ within 0..L, code = ((2·digit + 1)/L − 1) · L⁻ⁱ.
//!
//! So the digits of all layers are x written in base L. The scale L⁻ⁱ, the symmetric levels and the
//! soft bound in front of all layers are those of lucidrains' ResidualFSQ; its levels reach both ends
//! of the interval, where these lie in the middle of their parts, so that no layer has codes to spare.
//!
//! Shapes: b clips, t latents, n = b·t, c channels, d dimensions.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use super::dropout::Dropout;
use super::order::{by_clip, by_scale};
use super::{
    Extent, Quantized, Quantizer, begin_projections, clips, rows, running_sums, straight_through,
};
use crate::learn::layers::Affine;
use crate::learn::{LearnerState, LoadedState};
use crate::spec::{ResidualSpec, digits_of_index, index_of_digits, n_codes};

/// Deviations of a channel that are bounded to ±tanh 1 at the beginning.
const SPREAD: f32 = 1.3;

/// Digits of bounded numbers, between two linear projections.
#[derive(Module, Debug)]
pub struct ResidualFsq {
    project_in: Affine,
    project_out: Affine,
    #[module(skip)]
    levels: Vec<usize>,
    #[module(skip)]
    n_layers: usize,
    #[module(skip)]
    dropout: Dropout,
}

impl ResidualFsq {
    /// Layers of the same levels, at least 2 each, for latents of `code_dim` channels.
    pub fn new(
        spec: &ResidualSpec,
        levels: &[usize],
        code_dim: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        Self {
            project_in: Affine::new(code_dim, levels.len(), rng, device),
            project_out: Affine::new(levels.len(), code_dim, rng, device),
            levels: levels.to_vec(),
            n_layers: spec.layers,
            dropout: Dropout::new(spec.dropout, rng),
        }
    }

    /// x of the module's equation.
    fn bound(&self, latents_nc: Tensor<2>) -> Tensor<2> {
        self.project_in.forward(latents_nc).tanh()
    }

    /// L per dimension, `[1, d]`.
    fn bases(&self, device: &Device) -> Tensor<2> {
        let values: Vec<f32> = self.levels.iter().map(|level| *level as f32).collect();
        Tensor::from_data(TensorData::new(values, [1, self.levels.len()]), device)
    }

    /// The digits of layer `i` of what is left over.
    fn digits(&self, rest_nd: Tensor<2>, i: usize) -> Tensor<2> {
        let bases_1d = self.bases(&rest_nd.device());
        let stretched_nd = rest_nd * bases_1d.clone().powi_scalar(i as i32);
        let digits_nd = ((stretched_nd + 1.0) * bases_1d.clone() * 0.5).floor();
        digits_nd.clamp_min(0.0).min_pair(bases_1d - 1.0)
    }

    /// What the digits of layer `i` stand for.
    fn codes(&self, digits_nd: Tensor<2>, i: usize) -> Tensor<2> {
        let bases_1d = self.bases(&digits_nd.device());
        ((digits_nd * 2.0 + 1.0) / bases_1d.clone() - 1.0) / bases_1d.powi_scalar(i as i32)
    }

    fn ids_of_digits(&self, digits_nd: Tensor<2>) -> Vec<u32> {
        let digits = digits_nd.into_data().try_into_vec::<f32>().expect("digits are f32");
        let id = |digits: &[f32]| index_of_digits(&self.levels, digits.iter().map(|d| *d as usize));
        digits.chunks_exact(self.levels.len()).map(id).collect()
    }

    fn digits_of_ids(&self, ids: &[u32]) -> Tensor<2> {
        let digits = ids.iter().flat_map(|id| digits_of_index(&self.levels, *id));
        let values: Vec<f32> = digits.map(|digit| digit as f32).collect();
        let data = TensorData::new(values, [ids.len(), self.levels.len()]);
        Tensor::from_data(data, &self.project_out.device())
    }
}

impl Quantizer for ResidualFsq {
    /// Each dimension begins as a channel of its own, the first channels first.
    fn begin(&mut self, latents_nc: &Tensor<2>) {
        let projections = [&mut self.project_in, &mut self.project_out];
        begin_projections(projections, latents_nc, |deviation| {
            let spread = SPREAD * deviation.max(f32::MIN_POSITIVE);
            [1.0 / spread, spread]
        });
    }

    fn quantize(&mut self, latents_btc: Tensor<3>) -> Quantized {
        let n_clips = latents_btc.dims()[0];
        let bounded_nd = self.bound(rows(latents_btc));
        let plain_nd = bounded_nd.clone().detach();
        let mut sum_nd = plain_nd.zeros_like();
        for i in 0..self.dropout.layers(self.n_layers) {
            let digits_nd = self.digits(plain_nd.clone() - sum_nd.clone(), i);
            sum_nd = sum_nd + self.codes(digits_nd, i);
        }
        let straight_nd = straight_through(sum_nd, bounded_nd);
        let quantized_btc = clips(self.project_out.forward(straight_nd), n_clips);
        Quantized { quantized_btc, auxiliary_loss: None }
    }

    fn ids(&self, latents_btc: Tensor<3>) -> Vec<u32> {
        let n_clips = latents_btc.dims()[0];
        let bounded_nd = self.bound(rows(latents_btc));
        let mut sum_nd = bounded_nd.zeros_like();
        let layers = (0..self.n_layers).map(|i| {
            let digits_nd = self.digits(bounded_nd.clone() - sum_nd.clone(), i);
            sum_nd = sum_nd.clone() + self.codes(digits_nd.clone(), i);
            self.ids_of_digits(digits_nd)
        });
        by_clip(&layers.collect::<Vec<_>>(), n_clips)
    }

    fn lengths(&self, n_latents: usize) -> Vec<usize> {
        vec![n_latents; self.n_layers]
    }

    fn codebooks(&self) -> Vec<Tensor<2>> {
        let ids: Vec<u32> = (0..n_codes(&self.levels) as u32).collect();
        let of_layer = |i| self.project_out.forward(self.codes(self.digits_of_ids(&ids), i));
        (0..self.n_layers).map(of_layer).collect()
    }

    fn sums(&self, ids: &[u32], extent: Extent) -> Vec<Tensor<3>> {
        let scales = by_scale(ids, &self.lengths(extent.n_latents), extent.n_clips);
        let codes =
            scales.iter().enumerate().map(|(i, own)| self.codes(self.digits_of_ids(own), i));
        let embedded = |sum_nd| clips(self.project_out.forward(sum_nd), extent.n_clips);
        running_sums(codes).map(embedded).collect()
    }

    fn keep(&self) -> LearnerState {
        LearnerState { note: self.dropout.keep(), ..LearnerState::default() }
    }

    fn resume(&mut self, saved: LoadedState) -> Option<()> {
        self.dropout.resume(&saved.note)
    }
}
