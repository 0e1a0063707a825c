//! Every operation, in both versions, as a case: inputs, and a function of them.

use std::sync::Arc;

use burn::tensor::{Device, Tensor, TensorData};

use super::{Kernels, Rope, SequenceLayout};

mod attention;
mod bits;
mod gradients;
mod loss;

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

fn rms_norm(n: usize, d: usize) -> Case {
    let inputs = vec![input(n, d, 1), input(1, d, 2)];
    Case::new(format!("rms_norm {n} x {d}"), inputs, move |kernels, x| {
        kernels.rms_norm(x[0].clone(), x[1].clone().reshape([d]), 1e-5)
    })
}

fn swiglu(n: usize, f: usize) -> Case {
    let mut gate_up = input(n, 2 * f, 3);
    gate_up.values.iter_mut().for_each(|x| *x *= 4.0);
    Case::new(format!("swiglu {n} x {f}"), vec![gate_up], |kernels, x| kernels.swiglu(x[0].clone()))
}

fn cross_entropy(n: usize, n_vocab: usize) -> Case {
    let targets: Arc<[u32]> = (0..n).map(|i| (i * 7 % n_vocab) as u32).collect();
    let name = format!("cross_entropy {n} x {n_vocab}");
    Case::new(name, vec![input(n, n_vocab, 4)], move |kernels, x| {
        kernels.cross_entropy(x[0].clone(), &targets).reshape([1, 1])
    })
}

fn select_rows(m: usize, d: usize, n: usize) -> Case {
    let rows: Arc<[u32]> = (0..n).map(|i| (i * i % m) as u32).collect();
    Case::new(format!("select_rows {n} of {m} x {d}"), vec![input(m, d, 5)], move |kernels, x| {
        kernels.select_rows(x[0].clone(), &rows)
    })
}

fn attention(lengths: &[usize], prefixes: &[usize], n_head: usize, head_dim: usize) -> Case {
    let layout = Arc::new(SequenceLayout::new(lengths, prefixes).unwrap());
    let rope = Arc::new(Rope::new(layout.max_len(), head_dim, 10_000.0));
    let name = format!("attention {lengths:?} {prefixes:?} {n_head} x {head_dim}");
    let mut qkv = input(layout.n_rows(), 3 * n_head * head_dim, 6);
    qkv.values.iter_mut().for_each(|x| *x *= 2.0);
    Case::new(name, vec![qkv], move |kernels, x| {
        kernels.attention(x[0].clone(), n_head, &layout, &rope)
    })
}

/// Few numbers, of shapes that end within vectors and tiles.
fn small_cases() -> Vec<Case> {
    vec![
        rms_norm(3, 5),
        rms_norm(2, 19),
        swiglu(3, 5),
        swiglu(2, 17),
        cross_entropy(4, 6),
        cross_entropy(3, 21),
        select_rows(5, 3, 8),
        attention(&[4, 1, 6], &[2, 0, 6], 2, 4),
        attention(&[9, 18], &[0, 12], 1, 2),
    ]
}

/// The shapes of training.
fn large_cases() -> Vec<Case> {
    vec![
        rms_norm(200, 64),
        rms_norm(37, 100),
        swiglu(100, 168),
        cross_entropy(64, 512),
        cross_entropy(5, 20_003),
        select_rows(66, 64, 500),
        attention(&[50, 43, 17, 50], &[10, 20, 17, 0], 2, 8),
        attention(&[64, 33], &[0, 1], 2, 32),
        attention(&[201, 70], &[150, 5], 1, 64),
        attention(&[30], &[8], 2, 100),
        every_prefix_of_every_length(34),
    ]
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
#[allow(deprecated, reason = "the only other device that every build has")]
fn other_device() -> Device {
    Device::ndarray()
}
