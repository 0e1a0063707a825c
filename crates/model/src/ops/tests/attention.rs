//! The mask, the packing and the angles of attention.

use burn::tensor::Device;

use super::*;

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
