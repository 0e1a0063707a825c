//! The numbers of cross-entropy.

use burn::tensor::Device;

use super::*;

fn logits(rows: &[&[f32]]) -> Tensor<2> {
    let input = Input { values: rows.concat(), shape: [rows.len(), rows[0].len()] };
    tensor(&input, &Device::flex())
}

#[test]
fn huge_logits_give_finite_and_right_losses() {
    let huge: &[f32] = &[1e4, 0.0, -1e4];
    for kernels in [Kernels::Own, Kernels::Plain] {
        let nll = kernels.nll(logits(&[huge, huge, huge]), &[0, 1, 2]);
        assert_eq!(nll, [0.0, 1e4, 2e4], "{kernels:?}");
        let mean = kernels.cross_entropy(logits(&[huge, huge, huge]), &Arc::from([0, 1, 2]));
        assert_eq!(values(mean), [1e4], "{kernels:?}");
    }
}

#[test]
fn huge_logits_give_finite_and_right_gradients() {
    let x = logits(&[&[1e4, 0.0, -1e4], &[0.0, 0.0, 1e4]]).autodiff().require_grad();
    let gradients = Kernels::Own.cross_entropy(x.clone(), &Arc::from([1, 2])).backward();
    let gradient = values(x.grad(&gradients).unwrap());
    let right = [0.5, -0.5, 0.0, 0.0, 0.0, 0.0];
    assert!(relative_error(&gradient, &right) < 1e-6, "{gradient:?}");
}

#[test]
fn equal_logits_cost_the_logarithm_of_the_vocabulary() {
    for n_vocab in [1usize, 7, 512, 64_000] {
        let row = vec![-3.25; n_vocab];
        let nll = Kernels::Own.nll(logits(&[&row]), &[n_vocab as u32 - 1])[0];
        assert!((nll - (n_vocab as f64).ln()).abs() < 1e-6, "{n_vocab}: {nll}");
    }
}

#[test]
fn rows_losses_match_double_precision_and_average_to_the_mean() {
    let (n, n_vocab) = (9, 1003);
    let x = input(n, n_vocab, 21);
    let targets: Arc<[u32]> = (0..n as u32).map(|i| i * 101).collect();
    let right: Vec<f64> = x.values.chunks(n_vocab).zip(targets.iter()).map(double_nll).collect();
    for kernels in [Kernels::Own, Kernels::Plain] {
        let nll = kernels.nll(tensor(&x, &Device::flex().autodiff()), &targets);
        let worst = nll.iter().zip(&right).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 2e-6, "{kernels:?}: {worst:e}");
        let mean = values(kernels.cross_entropy(tensor(&x, &Device::flex()), &targets))[0];
        let right = right.iter().sum::<f64>() / n as f64;
        assert!((f64::from(mean) - right).abs() < 2e-6, "{kernels:?}: {mean} for {right}");
    }
}

fn double_nll((row, &target): (&[f32], &u32)) -> f64 {
    let total: f64 = row.iter().map(|&x| f64::from(x).exp()).sum();
    total.ln() - f64::from(row[target as usize])
}

#[test]
fn a_logit_that_is_no_number_is_not_hidden() {
    let nll = Kernels::Own.nll(logits(&[&[0.0, f32::NAN, 1.0], &[0.0, 1.0, 2.0]]), &[0, 0]);
    assert!(nll[0].is_nan() && nll[1].is_finite());
}

#[test]
#[should_panic(expected = "target 3 in a vocabulary of 3")]
fn a_target_outside_the_head_is_refused() {
    Kernels::Own.nll(logits(&[&[0.0, 1.0, 2.0]]), &[3]);
}
