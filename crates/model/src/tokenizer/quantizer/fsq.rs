//! Finite scalar quantization: of a whole latent, or of its digits, layer by layer.
//!
//! # At once
//!
//! As in ScaMo's code (Mentzer et al. 2023).
//!
//! A latent is projected to one number z per dimension, bounded and rounded:
//!
//! b = tanh(z + shift) · half − offset, r = round(b) with ties to even, code = r / ⌊L/2⌋
//!
//! where half = (L − 1)(1 + ε)/2, ε = 10⁻³; for an even L offset = ½ and
//! shift = atanh(offset / half), so that z = 0 gives r = 0; for an odd L both are 0. The paper
//! writes a sigmoid and codes 1..L, which is the same up to scale. With L = 2 the shift would
//! leave z = 0 on the flat of the tanh; there it is 0, and the sign of z decides.
//!
//! # Digits
//!
//! A latent is projected to one number z per dimension and bounded softly: x = tanh z. Layer i (from 0) rounds the
//! residual r of earlier layers to the middle of one of L equal parts of its interval, [−L⁻ⁱ, L⁻ⁱ]:
//!
//! digit = ⌊(r·Lⁱ + 1)/2 · L⌋ within 0..L, code = ((2·digit + 1)/L − 1) · L⁻ⁱ.
//!
//! So the digits of all layers are x written in base L. The scale L⁻ⁱ, the symmetric levels and the
//! soft bound in front of all layers follow lucidrains' ResidualFSQ; its levels reach both ends of the interval, while
//! these lie in the middle of their parts, so no layer has redundant codes.
//!
//! Shapes: b clips, t latents, n = b·t, c channels, d dimensions.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use super::{
    Dropout, Extent, Quantized, Quantizer, begin_projections, by_clip, by_scale, clips, rows,
    running_sums, straight_through,
};
use crate::learn::layers::Affine;
use crate::learn::{LearnerState, LoadedState};
use crate::spec::{ResidualSpec, digits_of_index, index_of_digits, n_codes};
use crate::tokenizer::halves::host;

/// Margin of the bound beyond the outermost level.
const EPSILON: f64 = 1e-3;

/// Deviations of a channel at which its outermost codes begin.
const OUTERMOST: f32 = 1.3;

/// Finite scalar quantization between two linear projections.
#[derive(Module, Debug)]
pub struct Fsq {
    project_in: Affine,
    project_out: Affine,
    #[module(skip)]
    levels: Vec<usize>,
}

impl Fsq {
    /// Levels of at least 2 each, for latents of `code_dim` channels.
    pub fn new(levels: &[usize], code_dim: usize, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            project_in: Affine::new(code_dim, levels.len(), rng, device),
            project_out: Affine::new(levels.len(), code_dim, rng, device),
            levels: levels.to_vec(),
        }
    }

    /// The embedding of each latent's code, `[n, c]`; the gradient passes straight through the rounding.
    pub fn embedded(&self, latents_nc: Tensor<2>) -> Tensor<2> {
        let bounded = self.bound(self.project_in.forward(latents_nc));
        let straight = straight_through(bounded.clone().round().detach(), bounded);
        let codes = straight.clone() / self.row(|level| (level / 2) as f64, &straight.device());
        self.project_out.forward(codes)
    }

    /// The code of each latent.
    pub fn codes_of(&self, latents_nc: Tensor<2>) -> Vec<u32> {
        self.ids_of_rounded(self.bound(self.project_in.forward(latents_nc)).round())
    }

    /// The embedding of each code, `[n, c]`.
    pub fn rows_of(&self, ids: &[u32]) -> Tensor<2> {
        let code = |(digit, &level): (usize, &usize)| {
            let middle = (level / 2) as f32;
            (digit as f32 - middle) / middle
        };
        let codes = |&id: &u32| digits_of_index(&self.levels, id).zip(&self.levels).map(code);
        let values: Vec<f32> = ids.iter().flat_map(codes).collect();
        let data = TensorData::new(values, [ids.len(), self.levels.len()]);
        let codes = Tensor::from_data(data, &self.project_out.device());
        self.project_out.forward(codes)
    }

    /// b of the module's equation.
    fn bound(&self, z_nd: Tensor<2>) -> Tensor<2> {
        let device = z_nd.device();
        let row = |value: fn(usize) -> f64| self.row(value, &device);
        (z_nd + row(shift)).tanh() * row(half) - row(offset)
    }

    /// One value per dimension, `[1, d]`.
    fn row(&self, value: impl Fn(usize) -> f64, device: &Device) -> Tensor<2> {
        let values: Vec<f32> = self.levels.iter().map(|&level| value(level) as f32).collect();
        Tensor::from_data(TensorData::new(values, [1, self.levels.len()]), device)
    }

    /// Ids of bounded and rounded values; exact, since it is done in integers.
    fn ids_of_rounded(&self, rounded_nd: Tensor<2>) -> Vec<u32> {
        let digit = |(&r, &level): (&f32, &usize)| (r as i64 + (level / 2) as i64) as usize;
        let id = |r: &[f32]| index_of_digits(&self.levels, r.iter().zip(&self.levels).map(digit));
        host(rounded_nd).chunks_exact(self.levels.len()).map(id).collect()
    }
}

impl Quantizer for Fsq {
    /// Each dimension starts as its own channel, the first channels first, with the outermost codes at 1.3 standard
    /// deviations.
    fn begin(&mut self, latents_nc: &Tensor<2>) {
        let projections = [&mut self.project_in, &mut self.project_out];
        begin_projections(projections, latents_nc, |deviation| {
            [1.0 / deviation.max(f32::MIN_POSITIVE), OUTERMOST * deviation]
        });
    }

    fn quantize(&mut self, latents_btc: Tensor<3>) -> Quantized {
        let n_clips = latents_btc.dims()[0];
        let quantized_btc = clips(self.embedded(rows(latents_btc)), n_clips);
        Quantized { quantized_btc, auxiliary_loss: None }
    }

    fn ids(&self, latents_btc: Tensor<3>) -> Vec<u32> {
        self.codes_of(rows(latents_btc))
    }

    fn codebooks(&self) -> Vec<Tensor<2>> {
        let ids: Vec<u32> = (0..n_codes(&self.levels) as u32).collect();
        vec![self.rows_of(&ids)]
    }

    fn sums(&self, ids: &[u32], extent: Extent) -> Vec<Tensor<3>> {
        vec![clips(self.rows_of(ids), extent.n_clips)]
    }
}

fn half(level: usize) -> f64 {
    (level - 1) as f64 * (1.0 + EPSILON) / 2.0
}

fn offset(level: usize) -> f64 {
    if level.is_multiple_of(2) { 0.5 } else { 0.0 }
}

fn shift(level: usize) -> f64 {
    if level == 2 { 0.0 } else { (offset(level) / half(level)).atanh() }
}

// The digits of a bounded latent.

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

    /// The digits of layer `i` of the residual.
    fn digits(&self, rest_nd: Tensor<2>, i: usize) -> Tensor<2> {
        let bases_1d = self.bases(&rest_nd.device());
        let stretched_nd = rest_nd * bases_1d.clone().powi_scalar(i as i32);
        let digits_nd = ((stretched_nd + 1.0) * bases_1d.clone() * 0.5).floor();
        digits_nd.clamp_min(0.0).min_pair(bases_1d - 1.0)
    }

    /// The values of the digits of layer `i`.
    fn codes(&self, digits_nd: Tensor<2>, i: usize) -> Tensor<2> {
        let bases_1d = self.bases(&digits_nd.device());
        ((digits_nd * 2.0 + 1.0) / bases_1d.clone() - 1.0) / bases_1d.powi_scalar(i as i32)
    }

    fn ids_of_digits(&self, digits_nd: Tensor<2>) -> Vec<u32> {
        let id = |digits: &[f32]| index_of_digits(&self.levels, digits.iter().map(|d| *d as usize));
        host(digits_nd).chunks_exact(self.levels.len()).map(id).collect()
    }

    fn digits_of_ids(&self, ids: &[u32]) -> Tensor<2> {
        let digits = ids.iter().flat_map(|id| digits_of_index(&self.levels, *id));
        let values: Vec<f32> = digits.map(|digit| digit as f32).collect();
        let data = TensorData::new(values, [ids.len(), self.levels.len()]);
        Tensor::from_data(data, &self.project_out.device())
    }
}

impl Quantizer for ResidualFsq {
    /// Each dimension starts as its own channel, the first channels first.
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    const SETS: [&[usize]; 4] = [&[8, 6, 5], &[8, 5, 5, 5], &[7, 5, 5, 5, 5], &[8, 8, 8, 5, 5, 5]];

    fn fsq(levels: &[usize], device: &Device) -> Fsq {
        Fsq::new(levels, 6, &mut ChaCha8Rng::seed_from_u64(0), device)
    }

    /// The id of a z in front of the bound, whatever the projection.
    fn id(levels: &[usize], z: impl Fn(usize) -> f32) -> u32 {
        let fsq = fsq(levels, &Device::flex());
        let values: Vec<f32> = (0..levels.len()).map(z).collect();
        let data = TensorData::new(values, [1, levels.len()]);
        fsq.ids_of_rounded(fsq.bound(Tensor::from_data(data, &Device::flex())).round())[0]
    }

    #[test]
    fn the_codes_of_scamo_are_met() {
        let zeros = SETS.map(|levels| id(levels, |_| 0.0));
        assert_eq!(zeros, [124, 500, 2187, 32036]);
        let alternating = |i: usize| 0.3 * (i + 1) as f32 * [1.0, -1.0][i % 2];
        assert_eq!(SETS.map(|levels| id(levels, alternating)), [165, 133, 3616, 10645]);
    }

    #[test]
    fn a_begun_fsq_keeps_the_first_channels() {
        let device = Device::flex();
        let mut fsq = Fsq::new(&[7, 5], 3, &mut ChaCha8Rng::seed_from_u64(0), &device);
        let values: Vec<f32> =
            (0..600).map(|i| ((i * i) as f32).sin() * (1 + i % 3) as f32).collect();
        let latents_nc = Tensor::<2>::from_data(TensorData::new(values, [200, 3]), &device);
        fsq.begin(&latents_nc);
        let latents_btc = latents_nc.clone().reshape([1, 200, 3]);
        let back_nc = fsq.rows_of(&fsq.ids(latents_btc));
        let square = |x: Tensor<2>| host((x.clone() * x).sum_dim(0));
        let (off, all) = (square(back_nc - latents_nc.clone()), square(latents_nc));
        let shares: Vec<f32> = off.iter().zip(&all).map(|(off, all)| off / all).collect();
        assert!(shares[0] < 0.1 && shares[1] < 0.15 && shares[2] > 0.99, "{shares:?}");
    }

    #[test]
    fn extreme_latents_take_the_first_and_the_last_code() {
        assert_eq!(SETS.map(|levels| id(levels, |_| -10.0)), [0; 4]);
        assert_eq!(SETS.map(|levels| id(levels, |_| 10.0)), [239, 999, 4374, 63999]);
    }

    #[test]
    fn two_levels_are_split_at_zero() {
        assert_eq!([-2.0, -0.1, 0.1, 2.0].map(|z| id(&[2], |_| z)), [0, 0, 1, 1]);
    }

    #[test]
    fn training_sees_the_embeddings_that_decoding_sees() {
        let device = Device::flex();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut fsq = fsq(&[8, 5, 5, 5], &device.clone().autodiff());
        let autodiff = device.autodiff();
        let latents = crate::learn::params::normal([2, 25, 6], 3.0, &mut rng, &autodiff).val();
        let trained = fsq.quantize(latents.clone()).quantized_btc.inner().into_data();
        let plain = fsq.valid();
        let ids = plain.ids(latents.inner());
        let embedded = plain.embed(&ids, Extent { n_clips: 2, n_latents: 25 });
        assert_eq!(embedded.into_data(), trained);
    }

    #[test]
    fn gradients_pass_straight_through_the_rounding() {
        let device = Device::flex().autodiff();
        let fsq_module = fsq(&[8, 6, 5], &device);
        let latents = crate::learn::params::constant([1, 4, 6], 0.2, &device).val();
        let quantized = fsq_module.clone().quantize(latents.clone()).quantized_btc;
        let grad = latents.grad(&quantized.sum().backward()).unwrap();
        assert!(grad.abs().max().into_scalar::<f32>() > 0.0);
    }
}
