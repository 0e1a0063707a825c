//! The objective of a parametric law, with its exact gradient and Hessian.
//!
//! L = s·E + Σ_k e^(c_k − α_k x_k), x_k being the centred ln of the k-th quantity, and
//! Σ w h(y − q), where q is L and y the loss, or q is ln L and y its logarithm, and h is Huber's
//! function (Huber 1964): r²/2 up to δ, δ(|r| − δ/2) beyond.
//!
//! With q's derivatives q_p and q_pq, the gradient is −Σ w h' q_p and the Hessian
//! Σ w (h'' q_p q_q − h' q_pq). In logarithms q_p = L_p/L and q_pq = L_pq/L − q_p q_q.

#![expect(clippy::needless_range_loop, reason = "loops of fixed bounds become vector instructions")]

use super::form::{Constant, MAX_PARAMS, Matrix, Space, Vector};

/// The rows of a fit as columns, padded with rows of no weight to whole lanes.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    /// Centred logarithms of the quantities.
    pub x: Vec<Vec<f64>>,
    /// The loss, or its logarithm.
    pub y: Vec<f64>,
    /// Rows before padding.
    pub n: usize,
}

impl Columns {
    /// Pads to whole lanes by repeating the last row.
    pub fn new(x: Vec<Vec<f64>>, y: Vec<f64>) -> Self {
        let n = y.len();
        Self { x: x.into_iter().map(padded).collect(), y: padded(y), n }
    }

    /// Weights of the rows, padded with zeros.
    pub fn weights(&self, mut weights: Vec<f64>) -> Vec<f64> {
        weights.resize(self.y.len(), 0.0);
        weights
    }
}

fn padded(mut column: Vec<f64>) -> Vec<f64> {
    let last = column.last().copied().unwrap_or(1.0);
    column.resize(column.len().next_multiple_of(LANES), last);
    column
}

/// The value of an objective and its derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Evaluation {
    pub value: f64,
    pub gradient: Vector,
    pub hessian: Matrix,
}

/// An objective in all parameters: c_1 … c_K, the constant, α_1 … α_K.
#[derive(Clone, Copy, Debug)]
pub(super) struct Objective<'a> {
    pub columns: &'a Columns,
    pub weights: &'a [f64],
    pub space: Space,
    pub constant: Constant,
    /// Huber's δ; infinite for least squares.
    pub delta: f64,
    pub curvature: Curvature,
}

/// The second derivatives in the Hessian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Curvature {
    /// All of them.
    Exact,
    /// The Gauss-Newton Hessian of Huber's function: never indefinite, so its steps are better far from an optimum.
    GaussNewton,
}

impl Objective<'_> {
    /// The objective at `theta`, whose first 2K + 1 entries count.
    pub fn evaluate(&self, theta: &Vector) -> Evaluation {
        match self.columns.x.len() {
            2 => self.evaluate_as::<2, 5>(theta),
            3 => self.evaluate_as::<3, 7>(theta),
            k => unreachable!("forms have two or three terms, not {k}"),
        }
    }

    fn evaluate_as<const K: usize, const P: usize>(&self, theta: &Vector) -> Evaluation {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                // SAFETY: the processor has just been seen to have both.
                return unsafe { wide512::<K, P>(self, theta) };
            }
            if is_x86_feature_detected!("avx2") {
                // SAFETY: the processor has just been seen to have it.
                return unsafe { wide256::<K, P>(self, theta) };
            }
        }
        sums::<K, P>(self, theta)
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq")]
fn wide512<const K: usize, const P: usize>(o: &Objective, theta: &Vector) -> Evaluation {
    sums::<K, P>(o, theta)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn wide256<const K: usize, const P: usize>(o: &Objective, theta: &Vector) -> Evaluation {
    sums::<K, P>(o, theta)
}

/// The sums over all rows, added in the same order for every vector width.
#[inline(always)]
fn sums<const K: usize, const P: usize>(o: &Objective, theta: &Vector) -> Evaluation {
    let mut value = [0.0; LANES];
    let mut gradient = [[0.0; LANES]; P];
    let mut hessian = [[[0.0; LANES]; P]; P];
    for start in (0..o.columns.y.len()).step_by(LANES) {
        let rows = start..start + LANES;
        let x: [Lane; K] = std::array::from_fn(|k| lane(&o.columns.x[k][rows.clone()]));
        let (y, w) = (lane(&o.columns.y[rows.clone()]), lane(&o.weights[rows]));
        let row = derivatives::<K, P>(o, theta, &x);
        let huber = huber(o, &y, &w, &row.q);
        add(&mut value, &huber.value);
        for p in 0..P {
            subtract_product(&mut gradient[p], &huber.slope, &row.first[p]);
            let scaled = product(&huber.outer, &row.first[p]);
            for q in 0..=p {
                add_product(&mut hessian[p][q], &scaled, &row.first[q]);
            }
        }
        if o.curvature == Curvature::GaussNewton {
            continue;
        }
        for k in 0..K {
            let (c, a) = (k, K + 1 + k);
            subtract_product(&mut hessian[c][c], &huber.slope, &row.first[c]);
            subtract_product(&mut hessian[a][c], &huber.slope, &row.first[a]);
            add_product(&mut hessian[a][a], &huber.slope, &product(&row.first[a], &x[k]));
        }
        if o.constant == Constant::Positive {
            subtract_product(&mut hessian[K][K], &huber.slope, &row.first[K]);
        }
    }
    gathered::<P>(&value, &gradient, &hessian)
}

/// Huber's function on some rows, times their weights.
struct Huber {
    value: Lane,
    /// h'.
    slope: Lane,
    /// The factor of q_p q_q: h'', plus h' in logarithms.
    outer: Lane,
}

#[inline(always)]
fn huber(o: &Objective, y: &Lane, w: &Lane, q: &Lane) -> Huber {
    let mut huber = Huber { value: [0.0; LANES], slope: [0.0; LANES], outer: [0.0; LANES] };
    let more = if o.space == Space::Log && o.curvature == Curvature::Exact { 1.0 } else { 0.0 };
    for i in 0..LANES {
        let r = y[i] - q[i];
        // δ(|r| − δ/2) beyond δ, written with |r| cut at δ so that δ may be infinite.
        let cut = r.abs().min(o.delta);
        let inside = if r.abs() <= o.delta { w[i] } else { 0.0 };
        huber.value[i] = w[i] * cut * (r.abs() - 0.5 * cut);
        huber.slope[i] = w[i] * cut.copysign(r);
        huber.outer[i] = inside + more * huber.slope[i];
    }
    huber
}

/// q and its first derivatives on some rows.
struct Row<const P: usize> {
    q: Lane,
    first: [Lane; P],
}

#[inline(always)]
fn derivatives<const K: usize, const P: usize>(
    o: &Objective,
    theta: &Vector,
    x: &[Lane; K],
) -> Row<P> {
    let constant = if o.constant == Constant::Positive { exp(theta[K]) } else { theta[K] };
    let constant_slope = if o.constant == Constant::Positive { constant } else { 1.0 };
    let mut row = Row { q: [constant; LANES], first: [[constant_slope; LANES]; P] };
    for k in 0..K {
        for i in 0..LANES {
            let term = exp(theta[k] - theta[K + 1 + k] * x[k][i]);
            row.q[i] += term;
            row.first[k][i] = term;
            row.first[K + 1 + k][i] = -x[k][i] * term;
        }
    }
    if o.space == Space::Log {
        for i in 0..LANES {
            let inverse = 1.0 / row.q[i];
            for p in 0..P {
                row.first[p][i] *= inverse;
            }
            row.q[i] = ln(row.q[i]);
        }
    }
    row
}

#[inline(always)]
fn gathered<const P: usize>(
    value: &Lane,
    gradient: &[Lane; P],
    hessian: &[[Lane; P]; P],
) -> Evaluation {
    let sum = |lane: &Lane| lane.iter().sum::<f64>();
    let mut all = Evaluation {
        value: sum(value),
        gradient: [0.0; MAX_PARAMS],
        hessian: [[0.0; MAX_PARAMS]; MAX_PARAMS],
    };
    for p in 0..P {
        all.gradient[p] = sum(&gradient[p]);
        for q in 0..=p {
            all.hessian[p][q] = sum(&hessian[p][q]);
            all.hessian[q][p] = all.hessian[p][q];
        }
    }
    all
}

// e^x and ln x for a handful of rows at a time.
//
// Branch-free, so that the compiler turns a loop over [`LANES`] rows into vector instructions;
// within an ulp or two of the standard library's, and the same bits on every processor, since
// nothing here depends on how wide its vectors are.

/// Rows that are computed side by side.
const LANES: usize = 8;

/// One number a row.
type Lane = [f64; LANES];

/// 1.5 · 2^52: adding it rounds to an integer in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// e^x; x beyond ±700 is taken as ±700.
#[inline(always)]
fn exp(x: f64) -> f64 {
    let x = x.clamp(-700.0, 700.0);
    let shifted = x * std::f64::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = x - n * LN2_HIGH - n * LN2_LOW;
    // e^r by its series to r^13, |r| < 0.35.
    let mut p = 1.0 / 6_227_020_800.0;
    p = p * r + 1.0 / 479_001_600.0;
    p = p * r + 1.0 / 39_916_800.0;
    p = p * r + 1.0 / 3_628_800.0;
    p = p * r + 1.0 / 362_880.0;
    p = p * r + 1.0 / 40_320.0;
    p = p * r + 1.0 / 5_040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    p = p * r + 1.0;
    p = p * r + 1.0;
    let exponent = shifted.to_bits().wrapping_add(1023) << 52;
    p * f64::from_bits(exponent)
}

/// ln x of a positive normal number.
#[inline(always)]
fn ln(x: f64) -> f64 {
    // x = m 2^e with m between √½ and √2.
    const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    let bits = x.to_bits().wrapping_sub(SQRT_HALF);
    let e_bits = ((bits as i64) >> 52) as u64;
    let m = f64::from_bits(x.to_bits().wrapping_sub(e_bits << 52));
    let e = f64::from_bits(ROUND.to_bits().wrapping_add(e_bits)) - ROUND;
    // ln m = 2 artanh s.
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let mut p = 1.0 / 21.0;
    p = p * z + 1.0 / 19.0;
    p = p * z + 1.0 / 17.0;
    p = p * z + 1.0 / 15.0;
    p = p * z + 1.0 / 13.0;
    p = p * z + 1.0 / 11.0;
    p = p * z + 1.0 / 9.0;
    p = p * z + 1.0 / 7.0;
    p = p * z + 1.0 / 5.0;
    p = p * z + 1.0 / 3.0;
    e * LN2_HIGH + (2.0 * s + (2.0 * s * z * p + e * LN2_LOW))
}

#[inline(always)]
fn product(a: &Lane, b: &Lane) -> Lane {
    std::array::from_fn(|i| a[i] * b[i])
}

#[inline(always)]
fn add(sum: &mut Lane, a: &Lane) {
    for i in 0..LANES {
        sum[i] += a[i];
    }
}

#[inline(always)]
fn add_product(sum: &mut Lane, a: &Lane, b: &Lane) {
    for i in 0..LANES {
        sum[i] += a[i] * b[i];
    }
}

#[inline(always)]
fn subtract_product(sum: &mut Lane, a: &Lane, b: &Lane) {
    for i in 0..LANES {
        sum[i] -= a[i] * b[i];
    }
}

/// The rows of a column that start a lane.
#[inline(always)]
fn lane(column: &[f64]) -> Lane {
    std::array::from_fn(|i| column[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn both_agree_with_the_standard_library(x in -650.0..650.0f64) {
            prop_assert!((exp(x) / x.exp() - 1.0).abs() < 5e-16);
            let y = x.exp();
            prop_assert!((ln(y) - y.ln()).abs() <= 4e-16 * y.ln().abs().max(0.3));
        }
    }

    #[test]
    fn whole_powers_are_exact_and_extremes_finite() {
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(ln(1.0), 0.0);
        assert!(exp(1e9).is_finite() && exp(-1e9) > 0.0);
    }
}
