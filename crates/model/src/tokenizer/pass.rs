//! [`Pass`]: what the halves of a tokenizer are told beside features and latents.

use burn::tensor::{Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

use super::captions::Captions;

/// What a pass reads beside features and latents.
#[derive(Default)]
pub struct Pass<'a> {
    /// The clips' captions, where the tokenizer has language.
    pub captions: Option<&'a Captions>,
    /// Draws what is dropped; `None` where nothing is, as outside training.
    pub noise: Option<ChaCha8Rng>,
}

impl<'a> Pass<'a> {
    /// A pass outside training.
    pub fn reading(captions: Option<&'a Captions>) -> Self {
        Self { captions, noise: None }
    }

    /// Each value 0 with probability `rate`, else larger by 1 / (1 − rate) (Srivastava et al. 2014); as
    /// it is outside training.
    pub fn drop<const D: usize>(&mut self, x: Tensor<D>, rate: f64) -> Tensor<D> {
        let Some(noise) = self.noise.as_mut().filter(|_| rate > 0.0) else { return x };
        let mut drawn = vec![0; 2 * x.shape().num_elements()];
        noise.fill_bytes(&mut drawn);
        let (least, kept) = (rate * f64::from(1u32 << 16), (1.0 / (1.0 - rate)) as f32);
        let value = |pair: &[u8]| {
            let drawn = u16::from_le_bytes([pair[0], pair[1]]);
            if f64::from(drawn) < least { 0.0 } else { kept }
        };
        let factors: Vec<f32> = drawn.chunks_exact(2).map(value).collect();
        let factors = Tensor::from_data(TensorData::new(factors, x.dims()), &x.device());
        x * factors
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;
    use rand_chacha::rand_core::SeedableRng;

    fn dropped(pass: &mut Pass, rate: f64) -> Vec<f32> {
        let ones = Tensor::<2>::ones([50, 40], &Device::flex());
        pass.drop(ones, rate).into_data().try_into_vec().unwrap()
    }

    #[test]
    fn what_is_dropped_follows_from_the_stream_and_keeps_the_mean() {
        let pass = || Pass { captions: None, noise: Some(ChaCha8Rng::seed_from_u64(3)) };
        let first = dropped(&mut pass(), 0.25);
        assert_eq!(first, dropped(&mut pass(), 0.25));
        let share = first.iter().filter(|x| **x == 0.0).count() as f64 / 2000.0;
        assert!((share - 0.25).abs() < 0.04, "{share}");
        assert!(first.iter().all(|x| *x == 0.0 || (x - 4.0 / 3.0).abs() < 1e-6));
    }

    #[test]
    fn nothing_is_dropped_outside_training_or_at_rate_0() {
        let noise = Some(ChaCha8Rng::seed_from_u64(3));
        for (mut pass, rate) in [(Pass::default(), 0.5), (Pass { captions: None, noise }, 0.0)] {
            assert!(dropped(&mut pass, rate).iter().all(|x| *x == 1.0));
        }
    }
}
