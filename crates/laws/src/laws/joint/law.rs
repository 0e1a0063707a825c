//! A joint law, as `laws.json` holds it.

use rayon::prelude::*;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::cost::Cost;
use super::loss::JointLoss;
use crate::laws::minima::types::Optimum;

/// A joint law, and all that a prediction needs of the cells it was fitted to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self")]
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
    #[serde(default)]
    pub bootstrap: Vec<Vec<f64>>,
}

impl Serialize for JointLaw {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

impl<'de> Deserialize<'de> for JointLaw {
    fn deserialize<D: Deserializer<'de>>(file: D) -> Result<Self, D::Error> {
        let law = Self::deserialize(file)?;
        let count = law.loss.terms.count();
        let all = [&law.loss.values].into_iter().chain(&law.bootstrap);
        let lengths: Vec<usize> = all.map(Vec::len).collect();
        match lengths.into_iter().find(|len| *len != count) {
            None => Ok(law),
            Some(other) => Err(D::Error::custom(format!(
                "the joint law has {other} coefficients, and its terms ask for {count}"
            ))),
        }
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
    pub fn optimum(&self, budget: f64) -> Option<Optimum> {
        self.cost.optimum(&self.loss, budget)
    }

    /// What an optimum has at an end of all that is looked at, and those ends: the loss has no valley between them.
    pub fn at_an_end(&self, optimum: &Optimum) -> Option<(&'static str, [f64; 2])> {
        self.cost.at_an_end(&self.loss, optimum)
    }

    /// The best allocations of some budgets by each replicate, where it has them.
    pub fn optima_at<const N: usize>(&self, budgets: [f64; N]) -> Vec<[Option<Optimum>; N]> {
        let of = |values: &Vec<f64>| {
            let loss = self.loss.with(values);
            budgets.map(|budget| self.cost.optimum(&loss, budget))
        };
        self.bootstrap.par_iter().map(of).collect()
    }

    /// The loss of an allocation by each replicate. The least loss of each replicate would lie lower: a surface
    /// that is moved at random has its minimum where chance made it low.
    pub fn losses_at(&self, place: &Optimum) -> Vec<f64> {
        let Optimum { params_nonvocab, n_vocab, tokens, .. } = *place;
        let of = |values: &Vec<f64>| {
            self.loss.with(values).at(params_nonvocab, n_vocab.unwrap_or_default(), tokens)
        };
        self.bootstrap.iter().map(of).filter(|loss| loss.is_finite()).collect()
    }

    /// The best allocation by each replicate that has one.
    pub fn optima(&self, budget: f64) -> Vec<Optimum> {
        self.optima_at([budget]).into_iter().filter_map(|[optimum]| optimum).collect()
    }
}
