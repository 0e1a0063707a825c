//! A parametric law, as `laws.json` holds it under the key `parametric`, and the best allocation by it.

use super::form::{Coefficients, Form, Space};
use crate::laws::input::Parameters;
use crate::laws::minima::Optimum;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A parametric law of the loss, how it was fitted, and how sure it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Written", try_from = "Written")]
pub struct Parametric {
    pub coefficients: Coefficients,
    pub space: Space,
    /// Whether the first exponent was kept equal to the last.
    pub tied: bool,
    /// Huber's δ in units of the loss or of its logarithm; none for least squares.
    pub huber_delta: Option<f64>,
    /// The sum over rows of Huber's function in logarithms; its mean if the loss itself is fitted.
    pub objective: f64,
    /// The sum over rows, either way.
    pub objective_sum: f64,
    /// Gradient norm of the sum, in the logarithms of the coefficients and in the exponents.
    pub gradient_norm: f64,
    pub starts: usize,
    /// Starts whose own optimum is the one reported, to 1e-8.
    pub starts_at_optimum: usize,
    /// Rows fitted.
    pub n: usize,
    /// 1 − RSS/TSS in the loss or its logarithm.
    pub r2: f64,
    /// Akaike's criterion as of least squares, in the loss or its logarithm.
    pub aic: f64,
    /// Standard deviations over the bootstrap, in the order of [`Form::names`]; empty without one.
    pub se: Vec<f64>,
    /// 95 % percentile intervals, likewise.
    pub ci95: Vec<[f64; 2]>,
    /// Replicates that ended at an optimum.
    pub replicates_converged: usize,
    pub bootstrap: Vec<Coefficients>,
    /// Rows with a large influence on the optimum at the largest requested budget.
    pub influence: Option<Influence>,
    /// Sentences for a person.
    pub warnings: Vec<String>,
}

/// A few rows that move a predicted optimum together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Influence {
    pub budget_flops: f64,
    /// Their names, the one that moves it most first.
    pub rows: Vec<String>,
    /// The optimal N (N_nv with a vocabulary) by all rows.
    pub params: f64,
    /// The same without these rows.
    pub params_without: f64,
}

/// [`Parametric`] as `laws.json` writes it: coefficients by name.
#[derive(Clone, Serialize, Deserialize)]
struct Written {
    form: Form,
    space: Space,
    tied: bool,
    huber_delta: Option<f64>,
    objective: f64,
    objective_sum: f64,
    gradient_norm: f64,
    starts: usize,
    starts_at_optimum: usize,
    n: usize,
    r2: f64,
    aic: f64,
    se: BTreeMap<String, f64>,
    ci95: BTreeMap<String, [f64; 2]>,
    replicates_converged: usize,
    /// One array a replicate, in the order of the form's names.
    bootstrap: Vec<Vec<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    influence: Option<Influence>,
    warnings: Vec<String>,
    #[serde(flatten)]
    coefficients: BTreeMap<String, f64>,
}

impl From<Parametric> for Written {
    fn from(p: Parametric) -> Self {
        let form = p.coefficients.form;
        Self {
            form,
            space: p.space,
            tied: p.tied,
            huber_delta: p.huber_delta,
            objective: p.objective,
            objective_sum: p.objective_sum,
            gradient_norm: p.gradient_norm,
            starts: p.starts,
            starts_at_optimum: p.starts_at_optimum,
            n: p.n,
            r2: p.r2,
            aic: p.aic,
            se: named(form, p.se),
            ci95: named(form, p.ci95),
            replicates_converged: p.replicates_converged,
            bootstrap: p.bootstrap.iter().map(|c| c.values().to_vec()).collect(),
            influence: p.influence,
            warnings: p.warnings,
            coefficients: named(form, p.coefficients.values().to_vec()),
        }
    }
}

impl TryFrom<Written> for Parametric {
    type Error = String;

    fn try_from(w: Written) -> Result<Self, String> {
        let coefficients = |values: &[f64]| {
            Coefficients::new(w.form, values).ok_or_else(|| "a coefficient is missing".to_string())
        };
        let bootstrap = w.bootstrap.iter().map(|values| coefficients(values));
        Ok(Self {
            coefficients: coefficients(&unnamed(w.form, &w.coefficients)?)?,
            bootstrap: bootstrap.collect::<Result<_, _>>()?,
            se: unnamed_or_none(w.form, &w.se)?,
            ci95: unnamed_or_none(w.form, &w.ci95)?,
            space: w.space,
            tied: w.tied,
            huber_delta: w.huber_delta,
            objective: w.objective,
            objective_sum: w.objective_sum,
            gradient_norm: w.gradient_norm,
            starts: w.starts,
            starts_at_optimum: w.starts_at_optimum,
            n: w.n,
            r2: w.r2,
            aic: w.aic,
            replicates_converged: w.replicates_converged,
            influence: w.influence,
            warnings: w.warnings,
        })
    }
}

fn named<T>(form: Form, values: Vec<T>) -> BTreeMap<String, T> {
    form.names().iter().map(ToString::to_string).zip(values).collect()
}

fn unnamed<T: Copy>(form: Form, named: &BTreeMap<String, T>) -> Result<Vec<T>, String> {
    let value = |name: &&str| named.get(*name).copied().ok_or(format!("{name} is missing"));
    form.names().iter().map(value).collect()
}

fn unnamed_or_none<T: Copy>(form: Form, named: &BTreeMap<String, T>) -> Result<Vec<T>, String> {
    if named.is_empty() { Ok(Vec::new()) } else { unnamed(form, named) }
}

// The compute-optimal allocation, under C = 6 N D.

/// FLOPs for a parameter and a token.
const FLOPS_PER_PARAM_TOKEN: f64 = 6.0;

/// The allocation of least loss that spends `budget` FLOPs; none if the coefficients have none.
///
/// For approach 3 it is N = G (C/6)^a with a = β/(α + β) and G = (αA/βB)^(1/(α+β)) (Hoffmann et al.
/// 2022, Eq. 4). With a vocabulary the gradient vanishes where α1 A1 N_nv^(−α1−1) =
/// α2 A2 N_v^(−α2−1), so that N_v is a power of N_nv with the exponent (1 + α1)/(1 + α2), and one
/// equation in ln N_nv is left, whose left side grows.
pub fn optimum(coefficients: &Coefficients, budget: f64) -> Option<Optimum> {
    let terms = coefficients.form.n_terms();
    let sound =
        (0..terms).all(|k| coefficients.coefficient(k) > 0.0 && coefficients.exponent(k) > 0.0);
    if !sound {
        return None;
    }
    let found = match coefficients.form.parameters() {
        Parameters::Total => of_total(coefficients, budget),
        Parameters::Split => of_split(coefficients, budget)?,
    };
    let finite = [found.params_nonvocab, found.tokens, found.loss].iter().all(|x| x.is_finite());
    finite.then_some(found)
}

fn of_total(c: &Coefficients, budget: f64) -> Optimum {
    let (alpha, beta) = (c.exponent(0), c.exponent(1));
    let ln_g = ((alpha * c.coefficient(0)).ln() - (beta * c.coefficient(1)).ln()) / (alpha + beta);
    let ln_work = (budget / FLOPS_PER_PARAM_TOKEN).ln();
    let params = (ln_g + beta / (alpha + beta) * ln_work).exp();
    let tokens = (alpha / (alpha + beta) * ln_work - ln_g).exp();
    let loss = c.loss(&[params, tokens]);
    Optimum { params_nonvocab: params, params_vocab: 0.0, n_vocab: None, tokens, loss }
}

/// The exponent of N_v in N_nv at the optima of a law with a vocabulary, (1 + α1)/(1 + α2).
pub fn vocab_exponent(c: &Coefficients) -> f64 {
    (1.0 + c.exponent(0)) / (1.0 + c.exponent(1))
}

/// ln N_v at an optimum whose N_nv is e^`ln_nonvocab`.
fn ln_vocab(c: &Coefficients, ln_nonvocab: f64) -> f64 {
    let steepness = |k: usize| (c.exponent(k) * c.coefficient(k)).ln();
    (steepness(1) - steepness(0)) / (1.0 + c.exponent(1)) + vocab_exponent(c) * ln_nonvocab
}

fn of_split(c: &Coefficients, budget: f64) -> Option<Optimum> {
    let work = budget / FLOPS_PER_PARAM_TOKEN;
    let at = |ln_nonvocab: f64| {
        let (n, v) = (ln_nonvocab.exp(), ln_vocab(c, ln_nonvocab).exp());
        (n, v, work / (n + v))
    };
    // ln of the gain by more data over the gain by a larger model.
    let imbalance = |ln_nonvocab: f64| {
        let (n, v, d) = at(ln_nonvocab);
        let data = (c.exponent(2) * c.coefficient(2)).ln() - c.exponent(2) * d.ln();
        let model = (c.exponent(0) * c.coefficient(0)).ln() - c.exponent(0) * n.ln();
        data + (n / (n + v)).ln() - model
    };
    let (n, v, d) = at(rising_zero(imbalance)?);
    let loss = c.loss(&[n, v, d]);
    Some(Optimum { params_nonvocab: n, params_vocab: v, n_vocab: None, tokens: d, loss })
}

/// The zero of a growing function of ln N, by bisection to the last bit; none without a change of
/// sign between e^−50 and e^100.
fn rising_zero(f: impl Fn(f64) -> f64) -> Option<f64> {
    let (mut low, mut high) = (-50.0, 100.0);
    if !(f(low) < 0.0 && f(high) > 0.0) {
        return None;
    }
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if f(middle) < 0.0 { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_optimum_of_epochs_chinchilla_is_the_published_one() {
        let values = [1.81721809, 477.82584, 2143.41736, 0.34731050, 0.36717243];
        let best = optimum(&Coefficients::new(Form::Approach3, &values).unwrap(), 5.76e23).unwrap();
        assert!((best.params_nonvocab / 73.19e9 - 1.0).abs() < 1e-3, "{best:?}");
        assert!((best.tokens / 1.3116e12 - 1.0).abs() < 1e-3, "{best:?}");
    }

    #[test]
    fn no_neighbour_of_an_optimum_on_the_budget_is_better() {
        let values = [6.0, 200.0, 8.0, 400.0, 0.35, 0.22, 0.38];
        let c = Coefficients::new(Form::Approach3Vocab, &values).unwrap();
        let best = optimum(&c, 1e17).unwrap();
        let loss = |n: f64, v: f64| c.loss(&[n, v, 1e17 / 6.0 / (n + v)]);
        let (n, v) = (best.params_nonvocab, best.params_vocab);
        assert!((6.0 * (n + v) * best.tokens / 1e17 - 1.0).abs() < 1e-12);
        for (f, g) in [(1.001, 1.0), (0.999, 1.0), (1.0, 1.001), (1.0, 0.999), (1.001, 0.999)] {
            assert!(loss(f * n, g * v) > best.loss, "{f} {g}");
        }
    }
}
