//! [`Lanes`]: sixteen `f32` at a time, on whatever vectors the machine has.
//!
//! All implementations see sixteen lanes, so sums are added in the same order everywhere.

/// The variable of the environment that names the vectors to use: `avx512`, `avx2` or `portable`.
pub const VECTORS: &str = "ISOFLOP_VECTORS";

/// Lanes of a vector.
pub const LANES: usize = 16;

/// Rows of a tile of a product, and vectors of [`LANES`] a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tile {
    /// For 32 registers of sixteen lanes: 24 sums, and what they are made of.
    SixByFour,
    /// For 16 registers of eight lanes, or 32 of four: twelve or 24 sums.
    SixByOne,
    /// For fewer.
    FourByOne,
}

impl Tile {
    /// Its columns.
    pub const fn columns(self) -> usize {
        match self {
            Tile::SixByFour => 4 * LANES,
            Tile::SixByOne | Tile::FourByOne => LANES,
        }
    }
}

/// Sixteen `f32`, element by element.
pub trait Lanes: Copy {
    /// The largest tile of a product that stays in the registers.
    const TILE: Tile;

    /// `x` in every lane.
    fn splat(x: f32) -> Self;

    /// All sixteen elements.
    fn load(x: &[f32; LANES]) -> Self;

    /// All sixteen elements.
    fn store(self, out: &mut [f32; LANES]);

    /// The first eight elements, and the others where that costs nothing.
    #[inline(always)]
    fn store_half(self, out: &mut [f32; LANES]) {
        self.store(out);
    }

    /// `self + other`.
    fn add(self, other: Self) -> Self;

    /// `self - other`.
    fn sub(self, other: Self) -> Self;

    /// `self other`.
    fn mul(self, other: Self) -> Self;

    /// `self / other`.
    fn div(self, other: Self) -> Self;

    /// The larger; `other` if either is NaN.
    fn max(self, other: Self) -> Self;

    /// The smaller; `other` if either is NaN.
    fn min(self, other: Self) -> Self;

    /// √self.
    fn sqrt(self) -> Self;

    /// The lanes of each pair changed over: 1, 0, 3, 2, …
    fn swap_pairs(self) -> Self;

    /// `self a + b`, rounded once if the machine has the instruction.
    fn mul_add(self, a: Self, b: Self) -> Self;

    /// 2ⁿ, with the integer n in the low bits of `self`, -126 <= n <= 127.
    fn power_of_two(self) -> Self;

    /// The lanes added as a tree: halves, quarters, eighths, pairs.
    fn sum(self) -> f32;

    /// The largest lane; NaN may be passed over.
    fn largest(self) -> f32;

    /// The first `n` lanes, then those of `rest`.
    fn first(self, n: usize, rest: Self) -> Self;

    /// Rows for columns of a square block, from matrix to matrix; each with the elements from row to row.
    #[inline(always)]
    fn transpose((from, rows): (&[f32], usize), (to, columns): (&mut [f32], usize)) {
        for i in 0..LANES {
            for (j, x) in from[i * rows..][..LANES].iter().enumerate() {
                to[j * columns + i] = *x;
            }
        }
    }

    /// Up to sixteen elements, with zeros after them.
    #[inline(always)]
    fn read(x: &[f32]) -> Self {
        match x.try_into() {
            Ok(whole) => Self::load(whole),
            Err(_) => {
                let mut padded = [0.0; LANES];
                padded[..x.len()].copy_from_slice(x);
                Self::load(&padded)
            }
        }
    }

    /// As many elements as `out` has room for.
    #[inline(always)]
    fn write(self, out: &mut [f32]) {
        match out.try_into() {
            Ok(whole) => self.store(whole),
            Err(_) => {
                let mut padded = [0.0; LANES];
                self.store(&mut padded);
                out.copy_from_slice(&padded[..out.len()]);
            }
        }
    }
}

/// Whether [`Lanes::mul_add`] of the portable version rounds once.
const FUSED: bool = cfg!(any(target_feature = "fma", target_arch = "aarch64"));

/// Methods of the portable version, lane by lane.
macro_rules! lane_by_lane {
    ($($method:ident($x:ident $(, $other:ident)*) $value:expr;)*) => {$(
        #[inline(always)]
        fn $method(self $(, $other: Self)*) -> Self {
            let $x = self;
            std::array::from_fn(|i| {
                let ($x, $($other),*) = ($x[i], $($other[i]),*);
                $value
            })
        }
    )*};
}

/// The portable version, which the compiler may or may not turn into vectors.
impl Lanes for [f32; LANES] {
    const TILE: Tile = if cfg!(target_arch = "aarch64") { Tile::SixByOne } else { Tile::FourByOne };

    #[inline(always)]
    fn splat(x: f32) -> Self {
        [x; LANES]
    }
    #[inline(always)]
    fn load(x: &[f32; LANES]) -> Self {
        *x
    }
    #[inline(always)]
    fn store(self, out: &mut [f32; LANES]) {
        *out = self;
    }

    lane_by_lane! {
        add(a, b) a + b;
        sub(a, b) a - b;
        mul(a, b) a * b;
        div(a, b) a / b;
        max(a, b) if a > b { a } else { b };
        min(a, b) if a < b { a } else { b };
        sqrt(a) a.sqrt();
        mul_add(x, a, b) if FUSED { x.mul_add(a, b) } else { x * a + b };
        power_of_two(a) f32::from_bits((a.to_bits() << 23).wrapping_add(1f32.to_bits()));
    }

    #[inline(always)]
    fn swap_pairs(self) -> Self {
        std::array::from_fn(|i| self[i ^ 1])
    }
    #[inline(always)]
    fn sum(mut self) -> f32 {
        for half in [8, 4, 2, 1] {
            for i in 0..half {
                self[i] += self[i + half];
            }
        }
        self[0]
    }
    #[inline(always)]
    fn largest(self) -> f32 {
        self.into_iter().fold(f32::MIN, |a, b| if b > a { b } else { a })
    }
    #[inline(always)]
    fn first(self, n: usize, rest: Self) -> Self {
        std::array::from_fn(|i| if i < n { self[i] } else { rest[i] })
    }
}
