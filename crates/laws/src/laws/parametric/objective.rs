//! The objective of a parametric law, with its exact gradient and Hessian.
//!
//! L = s·E + Σ_k e^(c_k − α_k x_k), x_k being the centred ln of the k-th quantity, and
//! Σ w h(y − q), where q is L and y the loss, or q is ln L and y its logarithm, and h is Huber's
//! function (Huber 1964): r²/2 up to δ, δ(|r| − δ/2) beyond.
//!
//! With q's derivatives q_p and q_pq, the gradient is −Σ w h' q_p and the Hessian
//! Σ w (h'' q_p q_q − h' q_pq). In logarithms q_p = L_p/L and q_pq = L_pq/L − q_p q_q.

#![expect(clippy::needless_range_loop, reason = "loops of fixed bounds become vector instructions")]

use std::ops::Range;

use super::form::{Constant, MAX_PARAMS, Matrix, Space, Vector};
use crate::laws::maths::lanes::{LANES, Lane, exp, fused, ln, product};

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
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                // SAFETY: the processor has just been seen to have both.
                return unsafe { wide256::<K, P>(self, theta) };
            }
        }
        evaluate::<K, P, { cfg!(target_arch = "aarch64") }>(self, theta)
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq")]
fn wide512<const K: usize, const P: usize>(o: &Objective, theta: &Vector) -> Evaluation {
    evaluate::<K, P, true>(o, theta)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn wide256<const K: usize, const P: usize>(o: &Objective, theta: &Vector) -> Evaluation {
    evaluate::<K, P, true>(o, theta)
}

/// Lanes of a chunk: its derivatives stay in the first cache, and a sum over it stays in a register.
const CHUNK: usize = 8;

/// One number for each row of a chunk.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Chunk([Lane; CHUNK]);

const ZERO: Chunk = Chunk([[0.0; LANES]; CHUNK]);

/// Derivatives on the rows of a chunk.
struct Derivatives<const P: usize> {
    q: Chunk,
    /// q_p.
    first: [Chunk; P],
    /// w h'.
    slope: Chunk,
    /// The factor of q_p q_q: w h'', plus w h' in logarithms.
    outer: Chunk,
}

/// Sums over rows, lane by lane.
struct Sums<const K: usize, const P: usize> {
    value: Lane,
    /// w h' q_p.
    slopes: [Lane; P],
    /// The lower half of the factor times q_p q_q.
    outer: [[Lane; P]; P],
    /// w h' x q_α of each exponent.
    bends: [Lane; K],
}

/// Over all rows, added in the same order for every vector width; if `FUSED`, a multiply-add rounds once.
#[inline(always)]
fn evaluate<const K: usize, const P: usize, const FUSED: bool>(
    o: &Objective,
    theta: &Vector,
) -> Evaluation {
    let zero = [0.0; LANES];
    let mut sums = Sums { value: zero, slopes: [zero; P], outer: [[zero; P]; P], bends: [zero; K] };
    let mut on = Derivatives { q: ZERO, first: [ZERO; P], slope: ZERO, outer: ZERO };
    let constant = match o.constant {
        Constant::Positive => [exp::<FUSED>(theta[K]); 2],
        Constant::Free => [theta[K], 1.0],
    };
    let lanes = o.columns.y.len() / LANES;
    for start in (0..lanes).step_by(CHUNK) {
        let range = start..lanes.min(start + CHUNK);
        let x: [&[Lane]; K] = std::array::from_fn(|k| part(&o.columns.x[k], &range));
        derive::<K, P, FUSED>(theta, &x, constant, &mut on);
        if o.space == Space::Log {
            logarithms::<P, FUSED>(&mut on, range.len());
        }
        weigh(o, part(&o.columns.y, &range), part(o.weights, &range), &mut on, &mut sums.value);
        add::<K, P, FUSED>(o, &x, &on, &mut sums);
    }
    gathered(o, &sums)
}

fn part<'a>(column: &'a [f64], lanes: &Range<usize>) -> &'a [Lane] {
    &column.as_chunks().0[lanes.clone()]
}

/// The loss and its first derivatives, from the constant and its own derivative.
#[inline(always)]
fn derive<const K: usize, const P: usize, const FUSED: bool>(
    theta: &Vector,
    x: &[&[Lane]; K],
    [constant, slope]: [f64; 2],
    on: &mut Derivatives<P>,
) {
    let n = x[0].len();
    on.q = Chunk([[constant; LANES]; CHUNK]);
    on.first[K] = Chunk([[slope; LANES]; CHUNK]);
    for k in 0..K {
        for i in 0..n {
            for j in 0..LANES {
                let x = x[k][i][j];
                let term = exp::<FUSED>(fused::<FUSED>(-theta[K + 1 + k], x, theta[k]));
                on.q.0[i][j] += term;
                on.first[k].0[i][j] = term;
                on.first[K + 1 + k].0[i][j] = -x * term;
            }
        }
    }
}

/// The same of the loss's logarithm.
#[inline(always)]
fn logarithms<const P: usize, const FUSED: bool>(on: &mut Derivatives<P>, n: usize) {
    for i in 0..n {
        let mut inverse = on.q.0[i];
        for j in 0..LANES {
            inverse[j] = 1.0 / inverse[j];
        }
        for p in 0..P {
            on.first[p].0[i] = product(&on.first[p].0[i], &inverse);
        }
    }
    for i in 0..n {
        for j in 0..LANES {
            on.q.0[i][j] = ln::<FUSED>(on.q.0[i][j]);
        }
    }
}

/// Huber's function, times the weights.
#[inline(always)]
fn weigh<const P: usize>(
    o: &Objective,
    y: &[Lane],
    w: &[Lane],
    on: &mut Derivatives<P>,
    value: &mut Lane,
) {
    let more = if o.space == Space::Log && o.curvature == Curvature::Exact { 1.0 } else { 0.0 };
    for i in 0..y.len() {
        for j in 0..LANES {
            let (r, w) = (y[i][j] - on.q.0[i][j], w[i][j]);
            // δ(|r| − δ/2) beyond δ, written with |r| cut at δ so that δ may be infinite.
            let cut = r.abs().min(o.delta);
            let inside = if r.abs() <= o.delta { w } else { 0.0 };
            let slope = w * cut.copysign(r);
            value[j] += w * cut * (r.abs() - 0.5 * cut);
            on.slope.0[i][j] = slope;
            on.outer.0[i][j] = inside + more * slope;
        }
    }
}

#[inline(always)]
fn add<const K: usize, const P: usize, const FUSED: bool>(
    o: &Objective,
    x: &[&[Lane]; K],
    on: &Derivatives<P>,
    sums: &mut Sums<K, P>,
) {
    let n = x[0].len();
    let mut factor = ZERO;
    dots::<P, P, FUSED>(&mut sums.slopes, &on.slope, &on.first, n);
    // Each row of the triangle has sums of its own number: a loop over the rows would keep them in memory.
    macro_rules! triangle {
        ($($p:literal)*) => { $(
            if $p < P {
                products(&mut factor, &on.outer.0[..n], &on.first[$p].0);
                dots::<{ $p + 1 }, P, FUSED>(&mut sums.outer[$p], &factor, &on.first, n);
            }
        )* };
    }
    triangle!(0 1 2 3 4 5 6);
    if o.curvature == Curvature::Exact {
        for k in 0..K {
            products(&mut factor, x[k], &on.slope.0);
            let first = std::array::from_ref(&on.first[K + 1 + k]);
            dots::<1, 1, FUSED>(std::array::from_mut(&mut sums.bends[k]), &factor, first, n);
        }
    }
}

/// The products of `a` with as many lanes of `b`.
#[inline(always)]
fn products(into: &mut Chunk, a: &[Lane], b: &[Lane; CHUNK]) {
    for i in 0..a.len().min(CHUNK) {
        into.0[i] = product(&a[i], &b[i]);
    }
}

/// Adds the products of `factor` with the first `N` derivatives, over `n` lanes.
#[inline(always)]
fn dots<const N: usize, const P: usize, const FUSED: bool>(
    sums: &mut [Lane; P],
    factor: &Chunk,
    first: &[Chunk; P],
    n: usize,
) {
    let mut own: [Lane; N] = std::array::from_fn(|q| sums[q]);
    for i in 0..n {
        for q in 0..N {
            for j in 0..LANES {
                own[q][j] = fused::<FUSED>(factor.0[i][j], first[q].0[i][j], own[q][j]);
            }
        }
    }
    sums[..N].copy_from_slice(&own);
}

/// The gradient −Σ w h' q_p, and the Hessian. A coefficient's own second derivative and its derivative by the
/// exponent are first derivatives again (q_cc = q_c, q_cα = q_α), so that their sums are the gradient's.
#[inline(always)]
fn gathered<const K: usize, const P: usize>(o: &Objective, sums: &Sums<K, P>) -> Evaluation {
    let sum = |lane: &Lane| lane.iter().sum::<f64>();
    let mut all = Evaluation {
        value: sum(&sums.value),
        gradient: [0.0; MAX_PARAMS],
        hessian: [[0.0; MAX_PARAMS]; MAX_PARAMS],
    };
    for p in 0..P {
        all.gradient[p] = -sum(&sums.slopes[p]);
        for q in 0..=p {
            all.hessian[p][q] = sum(&sums.outer[p][q]);
        }
    }
    if o.curvature == Curvature::Exact {
        for k in 0..K {
            all.hessian[k][k] += all.gradient[k];
            all.hessian[K + 1 + k][k] += all.gradient[K + 1 + k];
            all.hessian[K + 1 + k][K + 1 + k] += sum(&sums.bends[k]);
        }
        if o.constant == Constant::Positive {
            all.hessian[K][K] += all.gradient[K];
        }
    }
    for p in 0..P {
        for q in 0..p {
            all.hessian[q][p] = all.hessian[p][q];
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of three quantities, more than a chunk of them and no whole lane at the end.
    #[test]
    fn a_multiply_add_that_rounds_twice_moves_the_last_digits_alone() {
        let n = 3 * CHUNK * LANES / 2 + 3;
        let x = |k: usize| (0..n).map(|i| ((i * (k + 2) * 7 % 13) as f64 - 6.0) / 3.0).collect();
        let y = (0..n).map(|i| 0.5 + 0.1 * (i % 5) as f64).collect();
        let columns = Columns::new((0..3).map(x).collect(), y);
        let weights = columns.weights((0..n).map(|i| 0.5 + 0.1 * (i % 7) as f64).collect());
        let theta = [-0.4, -0.3, -0.8, 0.2, 0.3, 0.5, 0.4];
        for (space, constant) in [(Space::Log, Constant::Positive), (Space::Raw, Constant::Free)] {
            let (columns, weights, curvature) = (&columns, &weights, Curvature::Exact);
            let o = Objective { columns, weights, space, constant, delta: 0.3, curvature };
            let (once, twice) =
                (evaluate::<3, 7, true>(&o, &theta), evaluate::<3, 7, false>(&o, &theta));
            let near = |a: f64, b: f64| (a - b).abs() < 1e-12 * (1.0 + b.abs());
            assert!(near(once.value, twice.value));
            for p in 0..7 {
                assert!(near(once.gradient[p], twice.gradient[p]), "{p}");
                assert!((0..7).all(|q| near(once.hessian[p][q], twice.hessian[p][q])), "{p}");
            }
        }
    }
}
