//! Finite scalar quantization (Mentzer et al. 2023) as ScaMo's code has it.
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
//! Shapes: n latents, c channels, d dimensions.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use super::{Extent, Quantized, Quantizer, begin_projections, clips, rows, straight_through};
use crate::learn::layers::Affine;
use crate::spec::{digits_of_index, index_of_digits, n_codes};

/// How far past the outermost level the bound reaches.
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
        let values = rounded_nd.into_data().try_into_vec::<f32>().expect("latents are f32");
        let digit = |(&r, &level): (&f32, &usize)| (r as i64 + (level / 2) as i64) as usize;
        let id = |r: &[f32]| index_of_digits(&self.levels, r.iter().zip(&self.levels).map(digit));
        values.chunks_exact(self.levels.len()).map(id).collect()
    }
}

impl Quantizer for Fsq {
    /// Each dimension begins as a channel of its own, the first channels first, with the outermost codes
    /// at 1.3 deviations.
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
        let square = |x: Tensor<2>| (x.clone() * x).sum_dim(0).into_data().try_into_vec::<f32>();
        let off = square(back_nc - latents_nc.clone()).unwrap();
        let all = square(latents_nc).unwrap();
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
        assert_eq!(
            plain
                .embed(&plain.ids(latents.inner()), Extent { n_clips: 2, n_latents: 25 })
                .into_data(),
            trained
        );
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
