//! The most that a core multiplies: a product of large matrices, and multiply-adds of registers alone.

use std::hint::black_box;

use burn::tensor::{Device, Distribution, Tensor};
use isoflop::ops::{Convolution, Kernels, Taps};

/// Multiply-adds of a product of two matrices of 1024 x 1024, times two.
pub const PRODUCT_FLOPS: f64 = 2.0 * (1u64 << 30) as f64;

/// That product by burn's own crate `gemm`, or by isoflop (a convolution of one tap without a bias).
pub fn product(kernels: Kernels) -> impl FnMut() {
    let device = Device::flex();
    let [a, b] = [(); 2].map(|()| Tensor::<2>::random([1024; 2], Distribution::Default, &device));
    let (zero, taps) = (Tensor::zeros([1024], &device), Taps::Point);
    move || {
        let (a, b) = (a.clone(), b.clone());
        black_box(match kernels {
            Kernels::Own => {
                let once = Convolution { n_clips: 1, taps, rectify: false };
                kernels.convolve(a, b, zero.clone(), once)
            }
            _ => a.matmul(b),
        });
    }
}

/// Sums that do not wait for one another.
const SUMS: usize = 12;
const ROUNDS: usize = 1 << 22;

/// Times two, eight numbers a vector.
pub const LIMIT_FLOPS: f64 = (2 * 8 * SUMS * ROUNDS) as f64;

/// Multiply-adds of vectors that stay in registers, whose speed is bounded by clock and ports alone; AVX-512 if it is
/// in use. `None` on processors without AVX2.
pub fn limit() -> Option<fn()> {
    #[cfg(target_arch = "x86_64")]
    {
        let vectors = isoflop::ops::vectors().expect("the vectors asked for are there");
        match vectors {
            // SAFETY: the processor was asked and has them.
            "avx512" => return Some(|| unsafe { x86::avx512() }),
            // SAFETY: as above.
            "avx2" => return Some(|| unsafe { x86::avx2() }),
            _ => {}
        }
    }
    None
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{ROUNDS, SUMS, black_box};
    use std::arch::x86_64::*;

    #[target_feature(enable = "avx2,fma")]
    pub fn avx2() {
        let (mut sums, factor) = ([_mm256_set1_ps(1.0); SUMS], black_box(_mm256_set1_ps(0.5)));
        for _ in 0..ROUNDS {
            for sum in &mut sums {
                *sum = _mm256_fmadd_ps(*sum, factor, factor);
            }
        }
        black_box(sums);
    }

    #[target_feature(enable = "avx512f")]
    pub fn avx512() {
        let (mut sums, factor) = ([_mm512_set1_ps(1.0); SUMS], black_box(_mm512_set1_ps(0.5)));
        for _ in 0..ROUNDS / 2 {
            for sum in &mut sums {
                *sum = _mm512_fmadd_ps(*sum, factor, factor);
            }
        }
        black_box(sums);
    }
}
