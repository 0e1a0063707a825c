//! Codes, gradients and dead codes of the quantizer.

use super::*;
use crate::learn::params;
use crate::tokenizer::quantizer::averages::FIRST_COUNT;

fn vq(n_vocab: usize, code_dim: usize, device: &Device) -> Vq {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    Vq::new(n_vocab, code_dim, &TokenizerTraining::default(), &mut rng, device)
}

fn averages(n_vocab: usize) -> Averages {
    Averages::new(n_vocab, 1, ChaCha8Rng::seed_from_u64(0))
}

#[test]
fn a_code_that_falls_out_of_use_is_replaced_by_a_latent_of_the_batch() {
    let mut averages = averages(2);
    assert_eq!(averages.start(&[5.0, -5.0, 6.0]), [5.0, -5.0]);
    // Code 1 is not met: its count falls to 0.99, so it is reset. Code 0 is met three times.
    let codes = averages.follow(&[7.0, 8.0, 9.0], &[0, 0, 0]);
    assert_eq!(codes[1], 8.0);
    let expected = (0.99 * 5.0 + 0.01 * 24.0) / (0.99 + 0.03);
    assert!((codes[0] - expected).abs() < 1e-5, "{codes:?}");
}

#[test]
fn by_the_rule_of_shares_a_rare_code_counts_as_the_mean_from_then_on() {
    let mut averages = Averages { reset_share: 0.5, ..averages(2) };
    (averages.sums, averages.counts) = (vec![50.0, -0.1], vec![10.0, 0.1]);
    // Two latents a step, so the mean is 1: code 1 is below half of it.
    let codes = averages.follow(&[7.0, 7.0], &[0, 0]);
    assert_eq!((codes[1], averages.counts[1]), (7.0, 1.0));
    let expected = (0.99 * 50.0 + 0.01 * 14.0) / (0.99 * 10.0 + 0.02);
    assert!((codes[0] - expected).abs() < 1e-4, "{codes:?}");
}

#[test]
fn k_means_places_codes_among_the_latents() {
    let device = Device::flex();
    let mut vq = vq(2, 1, &device);
    vq.begin(&Tensor::from_data([[1.0], [1.2], [9.0], [9.2]], &device));
    let mut codes = vq.codebook.val().into_data().try_into_vec::<f32>().unwrap();
    codes.sort_by(f32::total_cmp);
    assert!((codes[0] - 1.1).abs() < 1e-5 && (codes[1] - 9.1).abs() < 1e-5, "{codes:?}");
    assert_eq!(vq.averages.counts, [FIRST_COUNT; 2]);
}

#[test]
fn a_small_batch_fills_a_large_codebook_with_noisy_copies() {
    let codes = averages(7).start(&[1.0, 2.0, 3.0]);
    let distance = |(i, code): (usize, &f32)| (code - [1.0, 2.0, 3.0][i % 3]).abs();
    assert!(codes.iter().enumerate().map(distance).all(|d| d > 0.0 && d < 0.1), "{codes:?}");
    assert_ne!(codes[0], codes[3]);
}

#[test]
fn the_nearest_code_is_taken_and_embedded() {
    let device = Device::flex();
    let mut vq = vq(3, 2, &device);
    vq.set_codebook(vec![0.0, 0.0, 1.0, 1.0, -1.0, 3.0]);
    let latents = Tensor::<3>::from_data([[[0.9, 0.8], [-0.2, 0.1], [-2.0, 2.0]]], &device);
    let ids = vq.ids(latents);
    assert_eq!(ids, [1, 0, 2]);
    let embedded = vq
        .embed(&ids, Extent { n_clips: 1, n_latents: 3 })
        .into_data()
        .try_into_vec::<f32>()
        .unwrap();
    assert_eq!(embedded, [1.0, 1.0, 0.0, 0.0, -1.0, 3.0]);
}

#[test]
fn gradients_reach_the_latents_and_not_the_codebook() {
    let device = Device::flex().autodiff();
    let mut vq = vq(2, 1, &device);
    let latents = params::constant([1, 3, 1], 0.5, &device).val();
    let quantized = vq.quantize(latents.clone());
    let loss = quantized.quantized_btc.sum() + quantized.auxiliary_loss.unwrap();
    let grads = loss.backward();
    let grad = latents.grad(&grads).unwrap().into_data().try_into_vec::<f32>().unwrap();
    assert!(grad.iter().all(|g| (g - 1.0).abs() < 1e-3), "{grad:?}");
    assert!(vq.codebook.val().grad(&grads).is_none());
}
