//! The same input gives the same bits.

use burn::tensor::Device;

use super::*;

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
