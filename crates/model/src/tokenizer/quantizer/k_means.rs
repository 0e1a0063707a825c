//! k-means of latents (Lloyd 1982).
//!
//! Shapes: n latents, c channels, v centres.

use burn::tensor::{Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use crate::learn::params::{below, distinct};
use crate::ops::nearest;
use crate::progress::moved;

/// Rounds after which the centres are taken.
const ROUNDS: usize = 15;

/// `n_centres` centres, row-major `[v, c]`, from latents drawn at random; a centre that no latent is
/// nearest to becomes another latent.
pub fn k_means(latents_nc: &Tensor<2>, n_centres: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let [n, c] = latents_nc.dims();
    let latents: Vec<f32> = latents_nc.clone().into_data().try_into_vec().expect("latents are f32");
    let latent = |i: usize| &latents[i * c..][..c];
    let first = distinct(n, n_centres, rng);
    let mut centres: Vec<f32> =
        first.iter().cycle().take(n_centres).flat_map(|i| latent(*i)).copied().collect();
    for _ in 0..ROUNDS {
        let data = TensorData::new(centres.clone(), [n_centres, c]);
        let ids = nearest(latents_nc, &Tensor::from_data(data, &latents_nc.device()));
        let (mut sums, mut counts) = (vec![0.0; n_centres * c], vec![0usize; n_centres]);
        for (latent, &id) in latents.chunks_exact(c).zip(&ids) {
            counts[id as usize] += 1;
            let sum = &mut sums[id as usize * c..][..c];
            sum.iter_mut().zip(latent).for_each(|(sum, x)| *sum += f64::from(*x));
        }
        for (v, count) in counts.into_iter().enumerate() {
            let centre = &mut centres[v * c..][..c];
            match count {
                0 => centre.copy_from_slice(latent(below(rng, n))),
                _ => centre
                    .iter_mut()
                    .zip(&sums[v * c..])
                    .for_each(|(x, sum)| *x = (sum / count as f64) as f32),
            }
        }
        moved();
    }
    centres
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;
    use rand_chacha::rand_core::SeedableRng;

    #[test]
    fn clusters_are_found() {
        let values: Vec<f32> = (0..300).map(|i| (i % 3) as f32 * 10.0 + (i as f32).sin()).collect();
        let latents = Tensor::from_data(TensorData::new(values, [300, 1]), &Device::flex());
        // A start with two centres in one cluster may stay there; one of these does not.
        let found = (0..4).any(|seed| {
            let mut centres = k_means(&latents, 3, &mut ChaCha8Rng::seed_from_u64(seed));
            centres.sort_by(f32::total_cmp);
            centres
                .iter()
                .zip([0.0, 10.0, 20.0])
                .all(|(found, centre)| (found - centre).abs() < 0.3)
        });
        assert!(found);
    }

    #[test]
    fn more_centres_than_latents_repeat_them() {
        let latents = Tensor::from_data([[1.0], [2.0]], &Device::flex());
        assert_eq!(k_means(&latents, 5, &mut ChaCha8Rng::seed_from_u64(0)).len(), 5);
    }
}
