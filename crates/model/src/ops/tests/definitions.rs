//! Attention, the head's loss and the nearest codes against their definitions in double precision.

use burn::tensor::Device;

use super::*;
use crate::ops::{nearest, plain};

// The mask, the packing and the angles of attention.

const N_HEAD: usize = 2;
const HEAD_DIM: usize = 4;
const COLUMNS: usize = 3 * N_HEAD * HEAD_DIM;

/// Attention of `[q | k | v]`, before the projection.
fn mixed(kernels: Kernels, qkv: &Input, options: &AttentionOptions) -> Vec<f32> {
    values(kernels.attend(tensor(qkv, &Device::flex()), options))
}

/// Output rows of attention over one sequence.
fn attend(kernels: Kernels, qkv: &Input, prefix: usize) -> Vec<Vec<f32>> {
    let output = mixed(kernels, qkv, &options(&[qkv.shape[0]], &[prefix], [N_HEAD, HEAD_DIM]));
    output.chunks(N_HEAD * HEAD_DIM).map(<[f32]>::to_vec).collect()
}

fn assert_mask_is_exact(kernels: Kernels, length: usize, prefix: usize) {
    let qkv = input(length, COLUMNS, 11);
    let before = attend(kernels, &qkv, prefix);
    for k in 0..length {
        let mut changed = qkv.clone();
        // Keys and values only: a position's own query always reaches its own output.
        let row = &mut changed.values[k * COLUMNS..][..COLUMNS];
        row[N_HEAD * HEAD_DIM..].iter_mut().for_each(|x| *x += 3.0);
        let after = attend(kernels, &changed, prefix);
        for q in 0..length {
            let sees = k <= q || (q < prefix && k < prefix);
            assert_eq!(before[q] != after[q], sees, "{kernels:?} {length} {prefix}: {q} of {k}");
        }
    }
}

#[test]
fn a_position_sees_what_the_mask_allows_and_nothing_else() {
    for kernels in [Kernels::Own, Kernels::Plain] {
        for (length, prefix) in [(6, 3), (6, 0), (5, 5), (7, 1), (21, 9), (1, 1)] {
            assert_mask_is_exact(kernels, length, prefix);
        }
    }
}

#[test]
fn packed_sequences_attend_as_each_does_alone() {
    let (first, second) = (input(19, COLUMNS, 12), input(6, COLUMNS, 13));
    let values = [first.values.clone(), second.values.clone()].concat();
    let both = Input { values, shape: [25, COLUMNS] };
    for kernels in [Kernels::Own, Kernels::Plain] {
        let packed = mixed(kernels, &both, &options(&[19, 6], &[4, 6], [N_HEAD, HEAD_DIM]));
        let alone = [attend(kernels, &first, 4), attend(kernels, &second, 6)].concat().concat();
        assert!(relative_error(&packed, &alone) < 1e-6, "{kernels:?}");
    }
}

/// Attention from its definition, in double precision, for one output row of one head.
fn reference(qkv: &Input, prefix: usize, head: usize, q: usize) -> Vec<f64> {
    let d = N_HEAD * HEAD_DIM;
    let part = |t: usize, part: usize| {
        let start = t * COLUMNS + part * d + head * HEAD_DIM;
        qkv.values[start..start + HEAD_DIM].iter().map(|&x| f64::from(x)).collect::<Vec<_>>()
    };
    // Turning both by their positions is turning one by the difference: Re(q conj(k) e^(i θ Δ)).
    let score = |k: usize| -> f64 {
        let (query, key) = (part(q, 0), part(k, 1));
        let pair = |i: usize| {
            let angle = (q as f64 - k as f64) * 10_000f64.powf(-2.0 * i as f64 / HEAD_DIM as f64);
            let (a, b) = (query[2 * i], query[2 * i + 1]);
            let (c, d) = (key[2 * i], key[2 * i + 1]);
            (a * c + b * d) * angle.cos() - (b * c - a * d) * angle.sin()
        };
        (0..HEAD_DIM / 2).map(pair).sum::<f64>() / (HEAD_DIM as f64).sqrt()
    };
    let sees = |&k: &usize| k <= q || (q < prefix && k < prefix);
    let powers: Vec<(usize, f64)> =
        (0..qkv.shape[0]).filter(sees).map(|k| (k, score(k).exp())).collect();
    let total: f64 = powers.iter().map(|(_, power)| power).sum();
    let feature = |i: usize| powers.iter().map(|(k, power)| power / total * part(*k, 2)[i]).sum();
    (0..HEAD_DIM).map(feature).collect()
}

#[test]
fn attention_is_what_its_definition_says() {
    let qkv = input(23, COLUMNS, 14);
    for kernels in [Kernels::Own, Kernels::Plain] {
        let output = attend(kernels, &qkv, 7);
        for (q, row) in output.iter().enumerate() {
            let right: Vec<f32> =
                (0..N_HEAD).flat_map(|h| reference(&qkv, 7, h, q)).map(|x| x as f32).collect();
            assert!(relative_error(row, &right) < 2e-6, "{kernels:?}, row {q}");
        }
    }
}

#[test]
fn scores_of_a_thousand_neither_overflow_nor_mix() {
    let mut qkv = input(20, COLUMNS, 15);
    qkv.values.iter_mut().for_each(|x| *x *= 100.0);
    let output = attend(Kernels::Own, &qkv, 5);
    assert!(output.concat().iter().all(|x| x.is_finite() && x.abs() <= 100.0));
}

#[test]
fn a_number_that_is_none_stays_visible() {
    let mut qkv = input(4, COLUMNS, 16);
    qkv.values[COLUMNS] = f32::NAN;
    let output = attend(Kernels::Own, &qkv, 0);
    assert!(output[1][0].is_nan() && output[0].iter().all(|x| x.is_finite()));
}

#[test]
fn a_spoilt_sequence_leaves_the_next_one_alone() {
    const WIDTH: usize = N_HEAD * HEAD_DIM;
    let mut case = attention(&[40, 19, 6], &[5, 3, 6], N_HEAD, HEAD_DIM);
    let clean = case.outcome(Kernels::Own, &Device::flex());
    case.inputs[0].values[..40 * WIDTH].fill(f32::NAN);
    let spoilt = case.outcome(Kernels::Own, &Device::flex());
    assert!(spoilt.output[0].is_nan() && spoilt.gradients[0][0].is_nan());
    assert_eq!(clean.output[40 * WIDTH..], spoilt.output[40 * WIDTH..]);
    assert_eq!(clean.gradients[0][40 * WIDTH..], spoilt.gradients[0][40 * WIDTH..]);
}

#[test]
#[should_panic(expected = "attention: 5 rows for a layout of 6")]
fn rows_that_do_not_fit_the_layout_are_refused() {
    let case = attention(&[6], &[0], N_HEAD, HEAD_DIM);
    let mut inputs = case.inputs.clone();
    inputs[0] = input(5, N_HEAD * HEAD_DIM, 1);
    case.output(Kernels::Own, &inputs, &Device::flex());
}

// The numbers of the head's loss.

/// A row x that RMSNorm leaves as it is, and weights that give these logits for it.
fn giving(logits: &[f32]) -> (Tensor<2>, HeadWeights) {
    let device = Device::flex();
    let weight = Input { values: logits.to_vec(), shape: [1, logits.len()] };
    let gamma_d = Tensor::ones([1], &device);
    (Tensor::ones([1, 1], &device), HeadWeights { gamma_d, weight_dv: tensor(&weight, &device) })
}

fn nll(kernels: Kernels, logits: &[f32], target: u32) -> f64 {
    let (x, weights) = giving(logits);
    kernels.head_nll(x, weights, &Arc::from([target]), 0.0).nats[0]
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
        let (x, weights) = giving(&vec![-3.25; n_vocab]);
        let found = Kernels::Own.head_nll(x, weights, &Arc::from([n_vocab as u32 - 1]), 0.0);
        let loss = found.nats[0];
        assert!((loss - (n_vocab as f64).ln()).abs() < 1e-6, "{n_vocab}: {loss}");
        assert_eq!(found.likeliest, [0], "the first of equals");
    }
}

#[test]
fn rows_losses_and_likeliest_columns_match_double_precision() {
    let (n, d, n_vocab) = (300, 3, 1003);
    let (x, gamma, weight) = (input(n, d, 21), input(1, d, 22), input(d, n_vocab, 23));
    let targets: Arc<[u32]> = (0..n as u32).map(|i| i * 101 % 1003).collect();
    let logits: Vec<Vec<f64>> = (0..n).map(|i| double_logits(&x, &gamma, &weight, i)).collect();
    let nll = |(logits, target): (&Vec<f64>, &u32)| {
        logits.iter().map(|logit| logit.exp()).sum::<f64>().ln() - logits[*target as usize]
    };
    let right: Vec<f64> = logits.iter().zip(&*targets).map(nll).collect();
    let device = Device::flex().autodiff();
    for kernels in [Kernels::Own, Kernels::Plain] {
        let weights = || HeadWeights {
            gamma_d: tensor(&gamma, &device).reshape([d]),
            weight_dv: tensor(&weight, &device),
        };
        let found = kernels.head_nll(tensor(&x, &device), weights(), &targets, 0.0);
        for (logits, id) in logits.iter().zip(&found.likeliest) {
            let largest = logits.iter().copied().fold(f64::MIN, f64::max);
            assert!(largest - logits[*id as usize] < 4e-6, "{kernels:?}: {id}");
        }
        assert_eq!(found.likeliest.len(), n);
        let worst = found.nats.iter().zip(&right).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 4e-6, "{kernels:?}: {worst:e}");
        let mean = values(kernels.head_loss(tensor(&x, &device), weights(), &targets, 0.0))[0];
        let right = right.iter().sum::<f64>() / n as f64;
        assert!((f64::from(mean) - right).abs() < 2e-6, "{kernels:?}: {mean} for {right}");
    }
}

/// The logits of row i.
fn double_logits(x: &Input, gamma: &Input, weight: &Input, i: usize) -> Vec<f64> {
    let [d, n_vocab] = weight.shape;
    let row: Vec<f64> = x.values[i * d..][..d].iter().map(|&x| f64::from(x)).collect();
    let rms = (row.iter().map(|x| x * x).sum::<f64>() / d as f64).sqrt();
    let element = |k: usize, j: usize| f64::from(weight.values[k * n_vocab + j]);
    let normed = |k: usize| row[k] / rms * f64::from(gamma.values[k]);
    (0..n_vocab).map(|j| (0..d).map(|k| normed(k) * element(k, j)).sum()).collect()
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

// Codes that are nearest, by both versions.

fn square_distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
}

/// Latents, channels, codes.
const SHAPES: [[usize; 3]; 6] =
    [[1, 1, 1], [7, 3, 2], [513, 33, 129], [700, 64, 1003], [40, 300, 520], [1030, 8, 4375]];

#[test]
fn no_code_is_nearer_than_the_one_that_is_taken() {
    for [n, c, v] in SHAPES {
        let (latents, codes) = (input(n, c, 31), input(v, c, 32));
        let device = Device::flex();
        let tensors = (tensor(&latents, &device), tensor(&codes, &device));
        let own = nearest(&tensors.0, &tensors.1);
        let plain = plain::nearest(&tensors.0, &tensors.1);
        for (latent, ids) in latents.values.chunks(c).zip(own.iter().zip(&plain)) {
            let distances: Vec<f64> =
                codes.values.chunks(c).map(|code| square_distance(latent, code)).collect();
            let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
            for id in [ids.0, ids.1] {
                assert!(distances[*id as usize] < least + 1e-5 * (1.0 + least), "{n} {c} {v}");
            }
        }
        assert_eq!((own.len(), plain.len()), (n, n));
    }
}

#[test]
fn latents_of_a_model_in_training_have_codes_too() {
    let device = Device::flex().autodiff();
    let [latents, codes] = [input(20, 4, 33), input(9, 4, 34)];
    let own = nearest(&tensor(&latents, &device), &tensor(&codes, &device));
    let outside = Device::flex();
    assert_eq!(own, nearest(&tensor(&latents, &outside), &tensor(&codes, &outside)));
    assert_eq!(nearest(&Tensor::zeros([0, 4], &outside), &tensor(&codes, &outside)), [0u32; 0]);
}
