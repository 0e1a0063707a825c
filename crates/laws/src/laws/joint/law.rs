//! A joint law, as `laws.json` holds it.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::cost::Cost;
use super::loss::JointLoss;
use super::optimum::JointOptimum;

/// A joint law, and all that a prediction needs of the cells it was fitted to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct JointLaw {
    pub loss: JointLoss,
    pub(super) cost: Cost,
    /// Root mean square of the residuals, in nats, on the degrees of freedom that the fit leaves.
    pub residual_sd: f64,
    /// Degrees of freedom of its square.
    pub dof: usize,
    /// Cells fitted.
    pub n: usize,
    /// The coefficients of each bootstrap replicate.
    pub bootstrap: Vec<Vec<f64>>,
}

/// A joint law as a file has it.
#[derive(Deserialize)]
struct Unchecked {
    loss: JointLoss,
    cost: Cost,
    residual_sd: f64,
    dof: usize,
    n: usize,
    #[serde(default)]
    bootstrap: Vec<Vec<f64>>,
}

impl TryFrom<Unchecked> for JointLaw {
    type Error = String;

    fn try_from(file: Unchecked) -> Result<Self, String> {
        let Unchecked { loss, cost, residual_sd, dof, n, bootstrap } = file;
        let (count, own) = (loss.terms.count(), loss.values.len());
        let others = bootstrap.iter().map(Vec::len);
        if let Some(other) = [own].into_iter().chain(others).find(|len| *len != count) {
            return Err(format!(
                "the joint law has {other} coefficients, and its terms ask for {count}"
            ));
        }
        Ok(Self { loss, cost, residual_sd, dof, n, bootstrap })
    }
}

impl JointLaw {
    /// Whether it says what repeated data is worth, and how well it knows that.
    pub fn tells_repetition(&self) -> bool {
        self.loss.terms.repeats && !self.bootstrap.is_empty()
    }

    /// The law where `unique_tokens` are distinct.
    pub fn on_data(&self, unique_tokens: f64) -> Self {
        let mut law = self.clone();
        law.loss.unique_tokens = Some(unique_tokens);
        law
    }

    /// The best allocation of `budget` FLOPs.
    pub fn optimum(&self, budget: f64) -> Option<JointOptimum> {
        self.cost.optimum(&self.loss, budget)
    }

    /// What an optimum has at an end of all that is looked at, and those ends: the loss has no valley between them.
    pub fn at_an_end(&self, optimum: &JointOptimum) -> Option<(&'static str, [f64; 2])> {
        self.cost.at_an_end(&self.loss, optimum)
    }

    /// The best allocations of some budgets by each replicate, where it has them.
    pub fn optima_at<const N: usize>(&self, budgets: [f64; N]) -> Vec<[Option<JointOptimum>; N]> {
        let of = |values: &Vec<f64>| {
            let loss = JointLoss { values: values.clone(), ..self.loss.clone() };
            budgets.map(|budget| self.cost.optimum(&loss, budget))
        };
        self.bootstrap.par_iter().map(of).collect()
    }

    /// The loss of an allocation by each replicate. The least loss of each replicate would lie lower: a surface
    /// that is moved at random has its minimum where chance made it low.
    pub fn losses_at(&self, place: &JointOptimum) -> Vec<f64> {
        let JointOptimum { params_nonvocab, n_vocab, tokens, .. } = *place;
        let of = |values: &Vec<f64>| {
            let loss = JointLoss { values: values.clone(), ..self.loss.clone() };
            loss.at(params_nonvocab, n_vocab, tokens)
        };
        self.bootstrap.iter().map(of).filter(|loss| loss.is_finite()).collect()
    }

    /// The best allocation by each replicate that has one.
    pub fn optima(&self, budget: f64) -> Vec<JointOptimum> {
        self.optima_at([budget]).into_iter().filter_map(|[optimum]| optimum).collect()
    }
}
