//! The objective of a parametric law, with its exact gradient and Hessian.
//!
//! L = s·E + Σ_k e^(c_k − α_k x_k), x_k being the centred ln of the k-th quantity, and
//! Σ w h(y − q), where q is L and y the loss, or q is ln L and y its logarithm, and h is Huber's
//! function (Huber 1964): r²/2 up to δ, δ(|r| − δ/2) beyond.
//!
//! With q's derivatives q_p and q_pq, the gradient is −Σ w h' q_p and the Hessian
//! Σ w (h'' q_p q_q − h' q_pq). In logarithms q_p = L_p/L and q_pq = L_pq/L − q_p q_q.

#![expect(clippy::needless_range_loop, reason = "loops of fixed bounds become vector instructions")]

use super::lanes::{LANES, Lane, add, add_product, exp, lane, ln, product, subtract_product};
use super::vector::{MAX_PARAMS, Matrix, Vector};
use serde::{Deserialize, Serialize};

/// What the residuals are taken of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Space {
    /// The logarithm of the loss.
    Log,
    /// The loss.
    Raw,
}

/// How the constant of a law is parametrised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Constant {
    /// E = e^θ, above zero.
    Positive,
    /// −E = θ, of either sign.
    Free,
}

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

/// Which second derivatives the Hessian holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Curvature {
    /// All of them.
    Exact,
    /// Those of Huber's function alone, as Gauss and Newton have it: never indefinite, so that far
    /// from an optimum its steps are the better ones.
    GaussNewton,
}

impl Objective<'_> {
    pub fn n_terms(&self) -> usize {
        self.columns.x.len()
    }

    /// The objective at `theta`, whose first 2K + 1 entries count.
    pub fn evaluate(&self, theta: &Vector) -> Evaluation {
        match self.n_terms() {
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

/// The sums over all rows. Additions stand in one order whatever the vectors' width is.
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
    /// What q_p q_q is multiplied by: h'', and in logarithms h' more.
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
