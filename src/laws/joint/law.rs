//! A joint law, as `laws.json` holds it.

use serde::{Deserialize, Serialize};

use super::cost::Cost;
use super::loss::JointLoss;
use super::optimum::JointOptimum;
use crate::laws::Candidate;

/// A joint law, and all that a prediction needs of the cells it was fitted to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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

impl JointLaw {
    /// Its name among the laws that can be recommended.
    pub fn candidate(&self) -> Candidate {
        if self.loss.terms.repeats { Candidate::JointRepeats } else { Candidate::Joint }
    }

    /// The best allocation of `budget` FLOPs.
    pub fn optimum(&self, budget: f64) -> Option<JointOptimum> {
        self.cost.optimum(&self.loss, budget)
    }

    /// The best allocation by each replicate that has one.
    pub fn optima(&self, budget: f64) -> Vec<JointOptimum> {
        let of = |values: &Vec<f64>| {
            let loss = JointLoss { values: values.clone(), ..self.loss.clone() };
            self.cost.optimum(&loss, budget)
        };
        self.bootstrap.iter().filter_map(of).collect()
    }
}
