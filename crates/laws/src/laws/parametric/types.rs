//! What a parametric fit holds: the key `parametric` of `laws.json`.

use super::form::{Coefficients, Form};
use super::influence::Influence;
use super::objective::Space;
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
    /// The sum over rows of Huber's function in logarithms, its mean where the loss itself is
    /// fitted.
    pub objective: f64,
    /// The sum over rows, either way.
    pub objective_sum: f64,
    /// Of the sum, in the logarithms of the coefficients and in the exponents.
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
    /// Rows that the optimum at the largest budget asked for hangs on.
    pub influence: Option<Influence>,
    /// Sentences for a person.
    pub warnings: Vec<String>,
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
