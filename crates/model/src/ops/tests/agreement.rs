//! Own kernels against their twins, both against finite differences, and each against itself: the same
//! input gives the same bits.

use burn::tensor::Device;

use super::*;

/// Step of the central differences: errors of order step², and of rounding / step.
const STEP: f32 = 1.0 / 128.0;

/// Derivative of the weighted sum of the outputs by each element of input `which`.
fn differences(case: &Case, kernels: Kernels, which: usize) -> Vec<f32> {
    let n = case.inputs[which].values.len();
    let at = |element: usize, step: f32| {
        let mut inputs = case.inputs.clone();
        inputs[which].values[element] += step;
        let output = case.output(kernels, &inputs, &Device::flex());
        let weights = noise(output.len(), 99);
        output.iter().zip(weights).map(|(y, w)| f64::from(*y) * f64::from(w)).sum::<f64>()
    };
    let slope = |i| ((at(i, STEP) - at(i, -STEP)) / (2.0 * f64::from(STEP))) as f32;
    (0..n).map(slope).collect()
}

fn assert_gradients_match_differences(kernels: Kernels) {
    for case in small_cases() {
        let outcome = case.outcome(kernels, &Device::flex());
        for (which, gradient) in outcome.gradients.iter().enumerate() {
            let error = relative_error(gradient, &differences(&case, kernels, which));
            assert!(error < 1e-3, "{}: gradient by input {which} off by {error:e}", case.name);
        }
    }
}

#[test]
fn own_gradients_match_finite_differences() {
    assert_gradients_match_differences(Kernels::Own);
}

#[test]
fn plain_gradients_match_finite_differences() {
    assert_gradients_match_differences(Kernels::Plain);
}

#[test]
fn own_kernels_match_their_twins() {
    for case in small_cases().into_iter().chain(large_cases()) {
        let own = case.outcome(Kernels::Own, &Device::flex());
        let plain = case.outcome(Kernels::Plain, &Device::flex());
        assert_close(&own, &plain, 1e-5, &case.name);
    }
}

#[test]
fn the_twins_match_own_kernels_from_another_device() {
    for case in small_cases() {
        let own = case.outcome(Kernels::Own, &Device::flex());
        let plain = case.outcome(Kernels::Plain, &other_device());
        assert_close(&plain, &own, 1e-5, &case.name);
    }
}

#[test]
fn strided_inputs_give_the_same_as_packed_ones() {
    for case in small_cases() {
        let strided = Case::new(case.name.clone(), transposed(&case.inputs), move |kernels, x| {
            let back: Vec<_> = x.iter().map(|x| x.clone().transpose()).collect();
            (case.operation)(kernels, &back)
        });
        let own = strided.outcome(Kernels::Own, &Device::flex());
        let plain = strided.outcome(Kernels::Plain, &Device::flex());
        assert_close(&own, &plain, 1e-5, &strided.name);
    }
}

fn transposed(inputs: &[Input]) -> Vec<Input> {
    let turn = |input: &Input| {
        let [rows, columns] = input.shape;
        let element = |k: usize| input.values[k % rows * columns + k / rows];
        Input { values: (0..rows * columns).map(element).collect(), shape: [columns, rows] }
    };
    inputs.iter().map(turn).collect()
}

#[test]
fn part_of_a_larger_tensor_is_read_from_where_it_lies() {
    let inputs = vec![input(7, 10, 8), input(1, 10, 1), input(10, 6, 2), input(3, 10, 3)];
    let case = Case::new("the last rows".into(), inputs, |kernels, x| {
        let (gamma_d, up_du, down_fd) = (x[1].clone().reshape([10]), x[2].clone(), x[3].clone());
        let weights = FeedForwardWeights { gamma_d, up_du, down_fd };
        let last = x[0].clone().slice([3..7, 0..10]);
        kernels.feed_forward(last, weights, Activation::SwiGlu, 1e-5)
    });
    let own = case.outcome(Kernels::Own, &Device::flex());
    assert_close(&own, &case.outcome(Kernels::Plain, &Device::flex()), 1e-5, &case.name);
}

#[test]
fn going_back_leaves_shared_inputs_as_they_were() {
    for case in small_cases() {
        let device = Device::flex().autodiff();
        let leaf = |input| tensor(input, &device).require_grad();
        let inputs: Vec<_> = case.inputs.iter().map(leaf).collect();
        (case.operation)(Kernels::Own, &inputs).sum().backward();
        for (before, after) in case.inputs.iter().zip(inputs) {
            assert_eq!(before.values, values(after), "{}", case.name);
        }
    }
}

#[test]
fn an_input_used_twice_gets_both_gradients() {
    let inputs = vec![input(4, 6, 7), input(1, 6, 1), input(6, 6, 2), input(3, 6, 3)];
    let case = Case::new("an input of two".into(), inputs, |kernels, x| {
        let (gamma_d, up_du, down_fd) = (x[1].clone().reshape([6]), x[2].clone(), x[3].clone());
        let weights = FeedForwardWeights { gamma_d, up_du, down_fd };
        let doubled = x[0].clone().mul_scalar(2.0);
        kernels.feed_forward(doubled.clone(), weights, Activation::SwiGlu, 1e-5).add(doubled)
    });
    let own = case.outcome(Kernels::Own, &Device::flex());
    assert_close(&own, &case.outcome(Kernels::Plain, &Device::flex()), 1e-5, &case.name);
}

/// Each operation has several products, one after the other; bf16 has three bits less than f16.
#[test]
fn half_precisions_are_near_single_precision() {
    for (half, tolerance) in [(HalfFloat::F16, 0.03), (HalfFloat::Bf16, 0.24)] {
        for case in small_cases().into_iter().chain(large_cases()) {
            let single = case.outcome(Kernels::Plain, &Device::flex());
            let found = case.outcome(Kernels::Half(half), &Device::flex());
            assert_close(&found, &single, tolerance, &format!("{half:?} {}", case.name));
        }
    }
}

#[test]
fn what_is_no_number_stays_none_where_it_is_rectified() {
    let mut case = convolve(Taps::Neighbours(1), true, [1, 5], [2, 3]);
    case.inputs[0].values[4] = f32::NAN;
    let outcome = case.outcome(Kernels::Own, &Device::flex());
    assert_eq!(outcome.output.iter().filter(|y| y.is_nan()).count(), 3 * 3);
    assert!(outcome.gradients[1].iter().any(|by| by.is_nan()));
}

// The same bits.

#[test]
fn a_repeat_gives_the_same_bits() {
    for case in small_cases().into_iter().chain(large_cases()) {
        let once = case.outcome(Kernels::Own, &Device::flex());
        assert_eq!(once, case.outcome(Kernels::Own, &Device::flex()), "{}", case.name);
    }
}

#[cfg(target_arch = "x86_64")]
mod instruction_sets {
    use super::*;
    use crate::ops::own::x86::{AT_MOST, Isa};

    /// The outcome on an instruction set, or nothing if this machine lacks it.
    fn outcome_on(isa: Isa, case: &Case) -> Option<Outcome> {
        AT_MOST.set(isa);
        let found = Isa::of_this_machine() == isa;
        let outcome = found.then(|| case.outcome(Kernels::Own, &Device::flex()));
        AT_MOST.set(Isa::Avx512);
        outcome
    }

    #[test]
    fn avx2_gives_the_same_bits_as_avx512() {
        for case in small_cases().into_iter().chain(large_cases()) {
            let sets = (outcome_on(Isa::Avx2, &case), outcome_on(Isa::Avx512, &case));
            let (Some(narrow), Some(wide)) = sets else {
                return println!("skipped: this machine lacks AVX-512 or AVX2");
            };
            assert_eq!(narrow, wide, "{}", case.name);
        }
    }

    #[test]
    fn codes_are_the_same_on_every_instruction_set() {
        let device = Device::flex();
        let (latents, codes) =
            (tensor(&input(700, 33, 41), &device), tensor(&input(1003, 33, 42), &device));
        let on = |isa: Isa| {
            AT_MOST.set(isa);
            let ids = crate::ops::nearest(&latents, &codes);
            AT_MOST.set(Isa::Avx512);
            ids
        };
        assert_eq!(on(Isa::Avx2), on(Isa::Avx512));
    }

    #[test]
    fn the_portable_kernels_match_the_twins() {
        for case in small_cases().into_iter().chain(large_cases()) {
            let plain = case.outcome(Kernels::Plain, &Device::flex());
            let portable = outcome_on(Isa::Baseline, &case).unwrap();
            assert_close(&portable, &plain, 1e-5, &case.name);
        }
    }
}
