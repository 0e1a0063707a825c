//! The numbers of the head's loss.

use burn::tensor::Device;

use super::*;

/// A row x that RMSNorm leaves as it is, and weights that give these logits for it.
fn giving(logits: &[f32]) -> (Tensor<2>, HeadWeights) {
    let device = Device::flex();
    let weight = Input { values: logits.to_vec(), shape: [1, logits.len()] };
    let gamma_d = Tensor::ones([1], &device);
    (Tensor::ones([1, 1], &device), HeadWeights { gamma_d, weight_dv: tensor(&weight, &device) })
}

fn nll(kernels: Kernels, logits: &[f32], target: u32) -> f64 {
    let (x, weights) = giving(logits);
    kernels.head_nll(x, weights, &Arc::from([target]), 0.0)[0]
}

#[test]
fn huge_logits_give_finite_and_right_losses() {
    let huge = [1e4, 0.0, -1e4];
    for kernels in [Kernels::Own, Kernels::Plain] {
        let losses = [0, 1, 2].map(|target| nll(kernels, &huge, target));
        assert_eq!(losses, [0.0, 1e4, 2e4], "{kernels:?}");
        let (x, weights) = giving(&huge);
        let mean = kernels.head_loss(x, weights, &Arc::from([1]), 0.0);
        assert_eq!(values(mean), [1e4], "{kernels:?}");
    }
}

#[test]
fn huge_logits_give_finite_and_right_gradients() {
    let (x, weights) = giving(&[1e4, 0.0, -1e4]);
    let weight_dv = weights.weight_dv.autodiff().require_grad();
    let weights = HeadWeights { gamma_d: weights.gamma_d.autodiff(), weight_dv: weight_dv.clone() };
    let loss = Kernels::Own.head_loss(x.autodiff(), weights, &Arc::from([1]), 0.0);
    let gradient = values(weight_dv.grad(&loss.backward()).unwrap());
    assert!(relative_error(&gradient, &[1.0, -1.0, 0.0]) < 1e-6, "{gradient:?}");
}

#[test]
fn equal_logits_cost_the_logarithm_of_the_vocabulary() {
    for n_vocab in [1usize, 7, 512, 64_000] {
        let loss = nll(Kernels::Own, &vec![-3.25; n_vocab], n_vocab as u32 - 1);
        assert!((loss - (n_vocab as f64).ln()).abs() < 1e-6, "{n_vocab}: {loss}");
    }
}

#[test]
fn rows_losses_match_double_precision_and_average_to_the_mean() {
    let (n, d, n_vocab) = (300, 3, 1003);
    let (x, gamma, weight) = (input(n, d, 21), input(1, d, 22), input(d, n_vocab, 23));
    let targets: Arc<[u32]> = (0..n as u32).map(|i| i * 101 % 1003).collect();
    let right: Vec<f64> = (0..n).map(|i| double_nll(&x, &gamma, &weight, i, targets[i])).collect();
    let device = Device::flex().autodiff();
    for kernels in [Kernels::Own, Kernels::Plain] {
        let weights = || HeadWeights {
            gamma_d: tensor(&gamma, &device).reshape([d]),
            weight_dv: tensor(&weight, &device),
        };
        let nll = kernels.head_nll(tensor(&x, &device), weights(), &targets, 0.0);
        let worst = nll.iter().zip(&right).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 4e-6, "{kernels:?}: {worst:e}");
        let mean = values(kernels.head_loss(tensor(&x, &device), weights(), &targets, 0.0))[0];
        let right = right.iter().sum::<f64>() / n as f64;
        assert!((f64::from(mean) - right).abs() < 2e-6, "{kernels:?}: {mean} for {right}");
    }
}

fn double_nll(x: &Input, gamma: &Input, weight: &Input, i: usize, target: u32) -> f64 {
    let [d, n_vocab] = weight.shape;
    let row: Vec<f64> = x.values[i * d..][..d].iter().map(|&x| f64::from(x)).collect();
    let rms = (row.iter().map(|x| x * x).sum::<f64>() / d as f64).sqrt();
    let element = |k: usize, j: usize| f64::from(weight.values[k * n_vocab + j]);
    let normed = |k: usize| row[k] / rms * f64::from(gamma.values[k]);
    let logit = |j: usize| (0..d).map(|k| normed(k) * element(k, j)).sum::<f64>();
    let total: f64 = (0..n_vocab).map(|j| logit(j).exp()).sum();
    total.ln() - logit(target as usize)
}

#[test]
fn a_logit_that_is_no_number_is_not_hidden() {
    assert!(nll(Kernels::Own, &[0.0, f32::NAN, 1.0], 0).is_nan());
    let mut many = vec![0.0; 3000];
    many[2900] = f32::NAN;
    assert!(nll(Kernels::Own, &many, 0).is_nan());
}

#[test]
#[should_panic(expected = "target 3 in a vocabulary of 3")]
fn a_target_outside_the_head_is_refused() {
    nll(Kernels::Own, &[0.0, 1.0, 2.0], 3);
}
