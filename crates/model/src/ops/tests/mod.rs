//! Every operation, in both versions, as a case: inputs, and a function of them.

use std::sync::Arc;

use burn::tensor::{Device, Tensor, TensorData};

use super::{
    Activation, AttentionOptions, AttentionWeights, BlockSequence, Convolution, CrossLayout,
    CrossOptions, FeedForwardWeights, HalfFloat, HeadWeights, Kernels, Rope, SequenceLayout, Taps,
};

mod agreement;
mod definitions;

/// A matrix by its elements and shape.
#[derive(Clone)]
struct Input {
    values: Vec<f32>,
    shape: [usize; 2],
}

/// One use of an operation.
struct Case {
    name: String,
    inputs: Vec<Input>,
    operation: Box<Operation>,
}

/// An operation of one or two matrices.
type Operation = dyn Fn(Kernels, &[Tensor<2>]) -> Tensor<2>;

/// What a case gives: the output, and the gradients of its sum under fixed weights.
#[derive(Debug, PartialEq)]
struct Outcome {
    output: Vec<f32>,
    gradients: Vec<Vec<f32>>,
}

/// Numbers in [-1, 1) without a pattern; another seed, other numbers.
fn noise(n: usize, seed: u64) -> Vec<f32> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(1);
    let mut next = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    (0..n).map(|_| next()).collect()
}

fn input(rows: usize, columns: usize, seed: u64) -> Input {
    Input { values: noise(rows * columns, seed), shape: [rows, columns] }
}

fn tensor(input: &Input, device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(input.values.clone(), input.shape), device)
}

fn values<const D: usize>(x: Tensor<D>) -> Vec<f32> {
    x.into_data().try_to_vec().unwrap()
}

impl Case {
    fn new(
        name: String,
        inputs: Vec<Input>,
        operation: impl Fn(Kernels, &[Tensor<2>]) -> Tensor<2> + 'static,
    ) -> Self {
        Self { name, inputs, operation: Box::new(operation) }
    }

    /// The output alone, outside autodiff.
    fn output(&self, kernels: Kernels, inputs: &[Input], device: &Device) -> Vec<f32> {
        let inputs: Vec<_> = inputs.iter().map(|input| tensor(input, device)).collect();
        values((self.operation)(kernels, &inputs))
    }

    /// Output and gradients.
    fn outcome(&self, kernels: Kernels, device: &Device) -> Outcome {
        let device = device.clone().autodiff();
        let leaf = |input| tensor(input, &device).require_grad();
        let inputs: Vec<_> = self.inputs.iter().map(leaf).collect();
        let output = (self.operation)(kernels, &inputs);
        let [rows, columns] = output.dims();
        let weights = tensor(&input(rows, columns, 99), &device);
        let gradients = output.clone().mul(weights).sum().backward();
        let gradient = |input: &Tensor<2>| values(input.grad(&gradients).unwrap());
        Outcome { gradients: inputs.iter().map(gradient).collect(), output: values(output) }
    }
}

fn feed_forward(n: usize, d: usize, f: usize, activation: Activation) -> Case {
    let u = if activation == Activation::SwiGlu { 2 * f } else { f };
    let inputs = vec![input(n, d, 1), input(1, d, 2), input(d, u, 3), input(f, d, 4)];
    let name = format!("{activation:?} {n} x {d} x {f}");
    Case::new(name, inputs, move |kernels, x| {
        let [gamma_d, up_du, down_fd] = [&x[1], &x[2], &x[3]].map(Tensor::clone);
        let gamma_d = gamma_d.reshape([d]);
        let weights = FeedForwardWeights { gamma_d, up_du, down_fd };
        kernels.feed_forward(x[0].clone(), weights, activation, 1e-5)
    })
}

fn head_loss(n: usize, d: usize, n_vocab: usize) -> Case {
    let targets: Arc<[u32]> = (0..n).map(|i| (i * 7 % n_vocab) as u32).collect();
    let inputs = vec![input(n, d, 1), input(1, d, 2), input(d, n_vocab, 4)];
    Case::new(format!("head_loss {n} x {d} x {n_vocab}"), inputs, move |kernels, x| {
        let (gamma_d, weight_dv) = (x[1].clone().reshape([d]), x[2].clone());
        let weights = HeadWeights { gamma_d, weight_dv };
        kernels.head_loss(x[0].clone(), weights, &targets, 1e-5).reshape([1, 1])
    })
}

fn select_rows(m: usize, d: usize, n: usize) -> Case {
    let rows: Arc<[u32]> = (0..n).map(|i| (i * i % m) as u32).collect();
    Case::new(format!("select_rows {n} of {m} x {d}"), vec![input(m, d, 5)], move |kernels, x| {
        kernels.select_rows(x[0].clone(), &rows)
    })
}

fn convolve(taps: Taps, rectify: bool, [n_clips, t]: [usize; 2], [c, o]: [usize; 2]) -> Case {
    let mut x = input(n_clips * t, c, 1);
    // Finite differences must not step over the corner of max(x, 0).
    x.values.iter_mut().for_each(|x| *x += 0.1f32.copysign(*x));
    let inputs = vec![x, input(taps.count() * c, o, 2), input(1, o, 3)];
    let convolution = Convolution { n_clips, taps, rectify };
    let name = format!("{convolution:?} of {t} frames, {c} to {o} channels");
    Case::new(name, inputs, move |kernels, x| {
        let [x_nc, weight, bias] = [&x[0], &x[1], &x[2]].map(Tensor::clone);
        kernels.convolve(x_nc, weight, bias.reshape([o]), convolution)
    })
}

fn rms_norm(n: usize, d: usize) -> Case {
    let inputs = vec![input(n, d, 1), input(1, d, 2)];
    Case::new(format!("rms_norm {n} x {d}"), inputs, move |kernels, x| {
        kernels.rms_norm(x[0].clone(), x[1].clone().reshape([d]), 1e-5)
    })
}

fn swi_glu(n: usize, f: usize) -> Case {
    let inputs = vec![input(n, 2 * f, 3)];
    Case::new(format!("swi_glu {n} x {f}"), inputs, move |kernels, x| kernels.swi_glu(x[0].clone()))
}

fn options(lengths: &[usize], prefixes: &[usize], heads: [usize; 2]) -> AttentionOptions {
    let [n_head, head_dim] = heads;
    let layout = Arc::new(SequenceLayout::new(lengths, prefixes).unwrap());
    let rope = Arc::new(Rope::new(layout.max_len(), head_dim, 10_000.0));
    AttentionOptions::new(n_head, layout, rope, 1e-5)
}

/// Sequences in blocks, each with its prefix; the angles of a sequence fall and rise.
fn block_options(sequences: &[(usize, &[usize])], heads: [usize; 2]) -> AttentionOptions {
    let [n_head, head_dim] = heads;
    let sequence = |(prefix, blocks): &(usize, &[usize])| {
        let n = prefix + blocks.iter().sum::<usize>();
        let angles = (0..n).map(|q| ((q * 5 + 3) % n) as u32).collect();
        BlockSequence { prefix: *prefix, blocks: (*blocks).into(), angles }
    };
    let sequences: Vec<BlockSequence> = sequences.iter().map(sequence).collect();
    let layout = Arc::new(SequenceLayout::in_blocks(&sequences).unwrap());
    let rope = Arc::new(Rope::new(layout.n_angles(), head_dim, 100.0));
    AttentionOptions::new(n_head, layout, rope, 1e-5)
}

fn attention(lengths: &[usize], prefixes: &[usize], n_head: usize, head_dim: usize) -> Case {
    let name = format!("attention {lengths:?} {prefixes:?} {n_head} x {head_dim}");
    attention_of(name, options(lengths, prefixes, [n_head, head_dim]))
}

fn block_attention(sequences: &[(usize, &[usize])], n_head: usize, head_dim: usize) -> Case {
    let name = format!("attention in blocks {sequences:?} {n_head} x {head_dim}");
    attention_of(name, block_options(sequences, [n_head, head_dim]))
}

fn attention_of(name: String, options: AttentionOptions) -> Case {
    let d = options.n_head * options.rope.head_dim();
    let n = options.layout.n_rows();
    let inputs = vec![input(n, d, 6), input(1, d, 2), input(d, 3 * d, 7), input(d, d, 8)];
    Case::new(name, inputs, move |kernels, x| {
        let [gamma_d, qkv_d3d, output_dd] = [&x[1], &x[2], &x[3]].map(Tensor::clone);
        let gamma_d = gamma_d.reshape([d]);
        let weights = AttentionWeights { gamma_d, qkv_d3d, output_dd };
        kernels.attention(x[0].clone(), weights, &options)
    })
}

fn attend(lengths: &[usize], prefixes: &[usize], n_head: usize, head_dim: usize) -> Case {
    let options = options(lengths, prefixes, [n_head, head_dim]);
    let qkv = input(options.layout.n_rows(), 3 * n_head * head_dim, 6);
    let name = format!("attend {lengths:?} {prefixes:?} {n_head} x {head_dim}");
    Case::new(name, vec![qkv], move |kernels, x| kernels.attend(x[0].clone(), &options))
}

/// Sequences of queries with memories; the angles of a memory lie between those of its queries.
fn cross_attend(sequences: &[[usize; 2]], is_turned: bool, heads: [usize; 2]) -> Case {
    let [n_head, head_dim] = heads;
    let [queries, memory]: [Vec<usize>; 2] =
        [0, 1].map(|part| sequences.iter().map(|counts| counts[part]).collect());
    let layout = Arc::new(CrossLayout::new(&queries, &memory));
    let angles = |counts: &[usize], step: f64| {
        let positions: Vec<f64> =
            (0..100).map(|t| t as f64 * step).take(counts.iter().copied().max().unwrap()).collect();
        Arc::new(Rope::at_positions(&positions, head_dim, 100.0))
    };
    let ropes = is_turned.then(|| [angles(&queries, 1.0), angles(&memory, 3.7)]);
    let d = n_head * head_dim;
    let inputs = vec![input(layout.n_queries(), d, 6), input(layout.n_memory(), 2 * d, 7)];
    let options = CrossOptions::new(n_head, layout, ropes);
    let name = format!("cross_attend {sequences:?} {heads:?}, turned: {is_turned}");
    Case::new(name, inputs, move |kernels, x| {
        kernels.cross_attend(x[0].clone(), x[1].clone(), &options)
    })
}

/// Few numbers, of shapes that end within vectors and tiles.
fn small_cases() -> Vec<Case> {
    vec![
        feed_forward(3, 5, 3, Activation::SwiGlu),
        feed_forward(2, 19, 17, Activation::SwiGlu),
        feed_forward(3, 4, 18, Activation::Gelu),
        head_loss(4, 3, 6),
        head_loss(3, 17, 21),
        select_rows(5, 3, 8),
        convolve(Taps::Point, true, [2, 3], [3, 4]),
        convolve(Taps::Neighbours(2), true, [2, 3], [2, 5]),
        convolve(Taps::Point, false, [2, 3], [19, 1]),
        convolve(Taps::Neighbours(1), true, [2, 3], [1, 1]),
        convolve(Taps::Halving, false, [2, 4], [3, 2]),
        convolve(Taps::Doubling, false, [2, 3], [2, 3]),
        attention(&[4, 1, 6], &[2, 0, 6], 2, 4),
        attention(&[9, 18], &[0, 12], 1, 2),
        block_attention(&[(2, &[1, 3]), (0, &[2, 2, 5])], 2, 4),
        block_attention(&[(3, &[2, 17])], 1, 2),
        attend(&[4, 1, 6], &[2, 0, 6], 2, 4),
        cross_attend(&[[4, 1], [1, 3], [6, 2]], true, [2, 4]),
        cross_attend(&[[5, 3]; 2], false, [1, 3]),
        rms_norm(3, 5),
        swi_glu(3, 19),
    ]
}

/// The shapes of training, and products of every shape.
fn large_cases() -> Vec<Case> {
    let mut cases = vec![
        feed_forward(300, 64, 168, Activation::SwiGlu),
        feed_forward(37, 100, 290, Activation::Gelu),
        feed_forward(130, 260, 40, Activation::SwiGlu),
        head_loss(64, 64, 512),
        head_loss(600, 36, 1001),
        head_loss(5, 20, 20_003),
        select_rows(66, 64, 500),
        convolve(Taps::Point, false, [5, 33], [64, 64]),
        convolve(Taps::Neighbours(9), true, [7, 20], [64, 64]),
        convolve(Taps::Neighbours(1), false, [3, 64], [263, 64]),
        convolve(Taps::Halving, true, [4, 64], [64, 64]),
        convolve(Taps::Doubling, true, [4, 32], [64, 263]),
        attention(&[50, 43, 17, 50], &[10, 20, 17, 0], 2, 8),
        attention(&[64, 33], &[0, 1], 2, 32),
        attention(&[201, 70], &[150, 5], 1, 64),
        attention(&[30], &[8], 2, 100),
        attend(&[72, 65], &[72, 65], 4, 16),
        cross_attend(&[[96, 24]; 3], true, [4, 16]),
        cross_attend(&[[40, 17], [19, 1], [1, 60]], false, [2, 32]),
        cross_attend(&[[17, 33], [33, 17]], true, [1, 6]),
        rms_norm(300, 64),
        swi_glu(130, 290),
        every_prefix_of_every_length(34),
        block_attention(&[(12, &[3, 6, 10, 15, 20, 25, 30, 36, 42, 49]), (5, &[1, 2, 30])], 2, 32),
        block_attention(&[(0, &[7, 9, 15, 16, 17, 33]), (31, &[1; 20])], 1, 4),
    ];
    cases.extend(products());
    cases
}

/// Products whose rows, inner elements and columns end everywhere within the tiles of every machine.
fn products() -> impl Iterator<Item = Case> {
    let sizes = [(1, 1), (5, 4), (6, 259), (7, 3), (200, 5)];
    let columns = [1, 15, 16, 17, 32, 33, 48, 49, 64, 65, 95, 96, 128, 255, 256, 257, 300];
    columns.into_iter().flat_map(move |columns| {
        sizes.map(|(rows, inner)| convolve(Taps::Point, false, [1, rows], [inner, columns]))
    })
}

/// Sequences of all lengths up to `longest`, the longest first, with all prefixes.
fn every_prefix_of_every_length(longest: usize) -> Case {
    let pairs = (1..=longest).rev().flat_map(|length| (0..=length).map(move |p| (length, p)));
    let (lengths, prefixes): (Vec<_>, Vec<_>) = pairs.unzip();
    attention(&lengths, &prefixes, 1, 4)
}

/// Largest difference, relative to the largest number.
fn relative_error(found: &[f32], right: &[f32]) -> f64 {
    assert_eq!(found.len(), right.len());
    let difference = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).abs();
    let largest = right.iter().fold(0.0, |largest: f64, x| largest.max(f64::from(x.abs())));
    // NaN must not pass, so no `f64::max` here.
    let worst =
        found.iter().zip(right).map(difference).fold(0.0, |a, b| if b <= a { a } else { b });
    worst / largest
}

fn assert_close(found: &Outcome, right: &Outcome, tolerance: f64, name: &str) {
    let error = relative_error(&found.output, &right.output);
    assert!(error < tolerance, "{name}: the output is off by {error:e}");
    for (i, (found, right)) in found.gradients.iter().zip(&right.gradients).enumerate() {
        let error = relative_error(found, right);
        assert!(error < tolerance, "{name}: the gradient by input {i} is off by {error:e}");
    }
}

#[test]
fn the_cpu_takes_own_kernels_and_other_devices_plain_ones() {
    assert_eq!(Kernels::for_device(&Device::flex()), Kernels::Own);
    assert_eq!(Kernels::for_device(&Device::flex().autodiff()), Kernels::Own);
    assert_eq!(Kernels::for_device(&other_device()), Kernels::Plain);
    assert_eq!(Kernels::for_device(&other_device().autodiff()), Kernels::Plain);
}

/// A device that is not `flex`.
#[expect(deprecated, reason = "the only other device that every build has")]
fn other_device() -> Device {
    Device::ndarray()
}
