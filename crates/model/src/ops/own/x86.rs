//! The vectors of x86-64.
//!
//! Values of these types exist only in kernels that [`vectorised!`](super::vectors::vectorised) picked after checking the
//! CPU: every `unsafe` here relies on this.

use std::arch::x86_64::*;
use std::sync::OnceLock;

use super::lanes::{LANES, Lanes, Tile, VECTORS};

/// The compiled version of a kernel for this CPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Isa {
    Baseline,
    Avx2,
    Avx512,
}

impl Isa {
    /// Every set with its name in [`VECTORS`].
    const ALL: [(&str, Self); 3] =
        [("avx512", Self::Avx512), ("avx2", Self::Avx2), ("portable", Self::Baseline)];

    /// The best set of the processor that [`VECTORS`] allows.
    pub fn of_this_machine() -> Self {
        static ALLOWED: OnceLock<Isa> = OnceLock::new();
        let allowed = *ALLOWED.get_or_init(|| Self::asked().unwrap_or(Self::Avx512));
        let best = Self::of_the_processor().min(allowed);
        #[cfg(test)]
        let best = best.min(AT_MOST.get());
        best
    }

    /// Asks the processor; the standard library remembers the answer.
    fn of_the_processor() -> Self {
        let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        let avx512 = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512bw");
        match (avx2, avx512) {
            (true, true) => Isa::Avx512,
            (true, false) => Isa::Avx2,
            _ => Isa::Baseline,
        }
    }

    /// The set that [`VECTORS`] names, or the processor's best without it.
    ///
    /// # Errors
    /// There is no such set, or the processor lacks it.
    pub fn asked() -> Result<Self, String> {
        let best = Self::of_the_processor();
        let Some(asked) = std::env::var_os(VECTORS) else { return Ok(best) };
        let found = Self::ALL.into_iter().find(|(name, _)| asked == *name);
        match found {
            Some((_, isa)) if isa <= best => Ok(isa),
            Some((name, _)) => Err(format!("{VECTORS} is {name}, which this processor lacks")),
            None => Err(format!(
                "{VECTORS} is `{}`; it may be avx512, avx2 or portable",
                asked.display()
            )),
        }
    }

    /// The name in [`VECTORS`].
    pub fn name(self) -> &'static str {
        Self::ALL.into_iter().find(|(_, isa)| *isa == self).map_or("", |(name, _)| name)
    }
}

#[cfg(test)]
thread_local! {
    /// Lets tests run this thread's kernels on lesser instruction sets too.
    pub static AT_MOST: std::cell::Cell<Isa> = const { std::cell::Cell::new(Isa::Avx512) };
}

/// One AVX-512 register.
#[derive(Clone, Copy)]
pub struct Wide(__m512);

/// Two AVX registers.
#[derive(Clone, Copy)]
pub struct Pair(__m256, __m256);

/// Methods that are one intrinsic of two operands.
macro_rules! binary {
    (Wide $($method:ident $intrinsic:ident),*) => {$(
        #[inline(always)]
        fn $method(self, other: Self) -> Self {
            // SAFETY: the processor has AVX-512, see the head of the file.
            Wide(unsafe { $intrinsic(self.0, other.0) })
        }
    )*};
    (Pair $($method:ident $intrinsic:ident),*) => {$(
        #[inline(always)]
        fn $method(self, other: Self) -> Self {
            // SAFETY: the processor has AVX2, see the head of the file.
            unsafe { Pair($intrinsic(self.0, other.0), $intrinsic(self.1, other.1)) }
        }
    )*};
}

/// Adds eight lanes as a tree.
///
/// # Safety
///
/// The processor must have AVX.
#[inline(always)]
unsafe fn sum_of_eight(x: __m256) -> f32 {
    // SAFETY: the caller's promise.
    unsafe {
        let four = _mm_add_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps(x, 1));
        let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
        _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)))
    }
}

/// The largest of eight lanes.
///
/// # Safety
///
/// The processor must have AVX.
#[inline(always)]
unsafe fn largest_of_eight(x: __m256) -> f32 {
    // SAFETY: the caller's promise.
    unsafe {
        let four = _mm_max_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps(x, 1));
        let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
        _mm_cvtss_f32(_mm_max_ss(two, _mm_movehdup_ps(two)))
    }
}

/// One bit for each of the first `n` lanes.
#[inline(always)]
fn mask(n: usize) -> __mmask16 {
    ((1u32 << n.min(LANES)) - 1) as __mmask16
}

/// Ones for as many lanes as a vector has, then zeros.
static FIRST_LANES: [[i32; LANES]; 2] = [[-1; LANES], [0; LANES]];

/// Methods that are sound once the processor has their instructions.
macro_rules! on_this_processor {
    ($(fn $method:ident($($argument:tt)*) $(-> $result:ty)? $body:block)*) => {$(
        #[inline(always)]
        fn $method($($argument)*) $(-> $result)? {
            // SAFETY: the processor has the instructions, see the head of the file; what is loaded and
            // stored lies within references, or within slices whose length a mask keeps to.
            unsafe { $body }
        }
    )*};
}

impl Lanes for Wide {
    const TILE: Tile = Tile::SixByFour;

    binary!(Wide add _mm512_add_ps, sub _mm512_sub_ps, mul _mm512_mul_ps, div _mm512_div_ps);
    binary!(Wide max _mm512_max_ps, min _mm512_min_ps);

    on_this_processor! {
        fn splat(x: f32) -> Self { Wide(_mm512_set1_ps(x)) }
        fn load(x: &[f32; LANES]) -> Self { Wide(_mm512_loadu_ps(x.as_ptr())) }
        fn store(self, out: &mut [f32; LANES]) { _mm512_storeu_ps(out.as_mut_ptr(), self.0) }
        fn sqrt(self) -> Self { Wide(_mm512_sqrt_ps(self.0)) }
        fn swap_pairs(self) -> Self { Wide(_mm512_permute_ps::<0b1011_0001>(self.0)) }
        fn mul_add(self, a: Self, b: Self) -> Self { Wide(_mm512_fmadd_ps(self.0, a.0, b.0)) }

        fn power_of_two(self) -> Self {
            let exponent = _mm512_slli_epi32(_mm512_castps_si512(self.0), 23);
            let one = _mm512_castps_si512(_mm512_set1_ps(1.0));
            Wide(_mm512_castsi512_ps(_mm512_add_epi32(exponent, one)))
        }

        fn sum(self) -> f32 {
            let high = _mm512_extractf32x8_ps(self.0, 1);
            sum_of_eight(_mm256_add_ps(_mm512_castps512_ps256(self.0), high))
        }

        fn largest(self) -> f32 {
            let high = _mm512_extractf32x8_ps(self.0, 1);
            largest_of_eight(_mm256_max_ps(_mm512_castps512_ps256(self.0), high))
        }

        fn first(self, n: usize, rest: Self) -> Self {
            Wide(_mm512_mask_blend_ps(mask(n), rest.0, self.0))
        }

        fn transpose((from, rows): (&[f32], usize), (to, columns): (&mut [f32], usize)) {
            has_block(from.len(), rows);
            has_block(to.len(), columns);
            let mut block = [Wide::splat(0.0); LANES];
            for (i, row) in block.iter_mut().enumerate() {
                row.0 = _mm512_loadu_ps(from.as_ptr().add(i * rows));
            }
            for (j, column) in transpose(block).into_iter().enumerate() {
                _mm512_storeu_ps(to.as_mut_ptr().add(j * columns), column.0);
            }
        }

        fn read(x: &[f32]) -> Self {
            match x.try_into() {
                Ok(whole) => Self::load(whole),
                Err(_) => Wide(_mm512_maskz_loadu_ps(mask(x.len()), x.as_ptr())),
            }
        }

        fn write(self, out: &mut [f32]) {
            // What a masked store writes cannot be read back until it has reached the cache.
            if let Ok(whole) = out.try_into() {
                return self.store(whole);
            }
            _mm512_mask_storeu_ps(out.as_mut_ptr(), mask(out.len()), self.0);
        }
    }
}

impl Lanes for Pair {
    const TILE: Tile = Tile::SixByOne;

    binary!(Pair add _mm256_add_ps, sub _mm256_sub_ps, mul _mm256_mul_ps, div _mm256_div_ps);
    binary!(Pair max _mm256_max_ps, min _mm256_min_ps);

    on_this_processor! {
        fn splat(x: f32) -> Self { Pair(_mm256_set1_ps(x), _mm256_set1_ps(x)) }

        fn load(x: &[f32; LANES]) -> Self {
            Pair(_mm256_loadu_ps(x.as_ptr()), _mm256_loadu_ps(x[8..].as_ptr()))
        }

        fn store(self, out: &mut [f32; LANES]) {
            let (low, high) = out.split_at_mut(8);
            _mm256_storeu_ps(low.as_mut_ptr(), self.0);
            _mm256_storeu_ps(high.as_mut_ptr(), self.1);
        }

        fn store_half(self, out: &mut [f32; LANES]) { _mm256_storeu_ps(out.as_mut_ptr(), self.0) }

        fn read(x: &[f32]) -> Self {
            if let Ok(whole) = x.try_into() {
                return Self::load(whole);
            }
            // Ones for the lanes that are there: a part of a row of ones and zeros.
            let masks = FIRST_LANES.as_flattened()[LANES - x.len().min(LANES)..].as_ptr();
            let low = _mm256_loadu_si256(masks.cast());
            let high = _mm256_loadu_si256(masks.add(8).cast());
            let rest = x.as_ptr().wrapping_add(8);
            Pair(_mm256_maskload_ps(x.as_ptr(), low), _mm256_maskload_ps(rest, high))
        }

        fn write(self, out: &mut [f32]) {
            if let Ok(whole) = out.try_into() {
                return self.store(whole);
            }
            // Eight, four, two and one: a masked store runs element by element on AMD's Jaguar (LLVM's review D66801).
            let (n, mut to, mut eight) = (out.len(), out.as_mut_ptr(), self.0);
            if n & 8 != 0 {
                _mm256_storeu_ps(to, eight);
                (to, eight) = (to.add(8), self.1);
            }
            let mut four = _mm256_castps256_ps128(eight);
            if n & 4 != 0 {
                _mm_storeu_ps(to, four);
                (to, four) = (to.add(4), _mm256_extractf128_ps(eight, 1));
            }
            if n & 2 != 0 {
                _mm_storel_pd(to.cast(), _mm_castps_pd(four));
                (to, four) = (to.add(2), _mm_movehl_ps(four, four));
            }
            if n & 1 != 0 {
                _mm_store_ss(to, four);
            }
        }

        fn sqrt(self) -> Self { Pair(_mm256_sqrt_ps(self.0), _mm256_sqrt_ps(self.1)) }

        fn swap_pairs(self) -> Self {
            let swap = |x| _mm256_permute_ps::<0b1011_0001>(x);
            Pair(swap(self.0), swap(self.1))
        }

        fn mul_add(self, a: Self, b: Self) -> Self {
            Pair(_mm256_fmadd_ps(self.0, a.0, b.0), _mm256_fmadd_ps(self.1, a.1, b.1))
        }

        fn power_of_two(self) -> Self {
            let power = |x| {
                let exponent = _mm256_slli_epi32(_mm256_castps_si256(x), 23);
                let one = _mm256_castps_si256(_mm256_set1_ps(1.0));
                _mm256_castsi256_ps(_mm256_add_epi32(exponent, one))
            };
            Pair(power(self.0), power(self.1))
        }

        fn sum(self) -> f32 { sum_of_eight(_mm256_add_ps(self.0, self.1)) }
        fn largest(self) -> f32 { largest_of_eight(_mm256_max_ps(self.0, self.1)) }

        fn first(self, n: usize, rest: Self) -> Self {
            let low = _mm256_setr_ps(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0);
            let high = _mm256_add_ps(low, _mm256_set1_ps(8.0));
            let n = _mm256_set1_ps(n as f32);
            let choose = |mine, other, lane| {
                _mm256_blendv_ps(other, mine, _mm256_cmp_ps::<_CMP_LT_OQ>(lane, n))
            };
            Pair(choose(self.0, rest.0, low), choose(self.1, rest.1, high))
        }

        fn transpose((from, rows): (&[f32], usize), (to, columns): (&mut [f32], usize)) {
            has_block(from.len(), rows);
            has_block(to.len(), columns);
            for (i, j) in [(0, 0), (8, 0), (0, 8), (8, 8)] {
                let (from, to) = (from.as_ptr().add(i * rows + j), to.as_mut_ptr().add(j * columns + i));
                let mut block = [_mm256_setzero_ps(); 8];
                for (i, row) in block.iter_mut().enumerate() {
                    *row = _mm256_loadu_ps(from.add(i * rows));
                }
                for (j, column) in transpose_eight(block).into_iter().enumerate() {
                    _mm256_storeu_ps(to.add(j * columns), column);
                }
            }
        }
    }
}

/// Sees that a matrix of so many elements, `stride` from row to row, has a square block at its start.
#[inline(always)]
fn has_block(elements: usize, stride: usize) {
    assert!((LANES - 1) * stride + LANES <= elements, "a block of a matrix ends beyond its memory");
}

/// Rows for columns of eight by eight: pairs of rows are merged to pairs, fours and eights of columns.
///
/// # Safety
///
/// The processor must have AVX.
#[inline(always)]
unsafe fn transpose_eight(rows: [__m256; 8]) -> [__m256; 8] {
    // SAFETY: the caller's promise.
    unsafe {
        let mut pairs = rows;
        for i in (0..8).step_by(2) {
            pairs[i] = _mm256_unpacklo_ps(rows[i], rows[i + 1]);
            pairs[i + 1] = _mm256_unpackhi_ps(rows[i], rows[i + 1]);
        }
        // Of each four rows and each half, its columns 0, 1, 2 and 3.
        let mut fours = pairs;
        for i in [0, 4] {
            for j in 0..2 {
                let (a, b) = (pairs[i + j], pairs[i + j + 2]);
                fours[i + 2 * j] = _mm256_shuffle_ps::<0x44>(a, b);
                fours[i + 2 * j + 1] = _mm256_shuffle_ps::<0xee>(a, b);
            }
        }
        let mut columns = fours;
        for j in 0..4 {
            columns[j] = _mm256_permute2f128_ps::<0x20>(fours[j], fours[j + 4]);
            columns[j + 4] = _mm256_permute2f128_ps::<0x31>(fours[j], fours[j + 4]);
        }
        columns
    }
}

/// Rows for columns: pairs of rows are merged to pairs, fours, eights and sixteens of columns.
///
/// # Safety
///
/// The processor must have AVX-512.
#[inline(always)]
unsafe fn transpose(rows: [Wide; LANES]) -> [Wide; LANES] {
    // SAFETY: the caller's promise.
    unsafe {
        let mut pairs = rows;
        for i in (0..LANES).step_by(2) {
            pairs[i].0 = _mm512_unpacklo_ps(rows[i].0, rows[i + 1].0);
            pairs[i + 1].0 = _mm512_unpackhi_ps(rows[i].0, rows[i + 1].0);
        }
        // Of each four rows and each quarter, its columns 0, 1, 2 and 3.
        let mut fours = pairs;
        for i in (0..LANES).step_by(4) {
            for (j, pair) in [i, i + 1].into_iter().enumerate() {
                let (a, b) = (_mm512_castps_pd(pairs[pair].0), _mm512_castps_pd(pairs[pair + 2].0));
                fours[i + 2 * j].0 = _mm512_castpd_ps(_mm512_unpacklo_pd(a, b));
                fours[i + 2 * j + 1].0 = _mm512_castpd_ps(_mm512_unpackhi_pd(a, b));
            }
        }
        let mut columns = fours;
        for j in 0..4 {
            let (a, b) = (fours[j].0, fours[j + 4].0);
            let (c, d) = (fours[j + 8].0, fours[j + 12].0);
            let even = [_mm512_shuffle_f32x4::<0x88>(a, b), _mm512_shuffle_f32x4::<0x88>(c, d)];
            let odd = [_mm512_shuffle_f32x4::<0xdd>(a, b), _mm512_shuffle_f32x4::<0xdd>(c, d)];
            columns[j].0 = _mm512_shuffle_f32x4::<0x88>(even[0], even[1]);
            columns[j + 4].0 = _mm512_shuffle_f32x4::<0x88>(odd[0], odd[1]);
            columns[j + 8].0 = _mm512_shuffle_f32x4::<0xdd>(even[0], even[1]);
            columns[j + 12].0 = _mm512_shuffle_f32x4::<0xdd>(odd[0], odd[1]);
        }
        columns
    }
}
