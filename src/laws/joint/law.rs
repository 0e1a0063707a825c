//! A joint law, as `laws.json` holds it.

use serde::{Deserialize, Serialize};

use super::cost::Cost;
use super::loss::JointLoss;
use super::optimum::JointOptimum;
use super::problem::noise_of;
use super::weighed::{place, valley};
use crate::laws::minima::Grid;
use crate::laws::{Candidate, RunNoise};

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

    /// How far the law lies above the cells of a budget: the mean over its valley, and the standard
    /// deviation that the noise of the runs gives this mean.
    pub(in crate::laws) fn above(&self, grid: &Grid, noise: Option<RunNoise>) -> [f64; 2] {
        let noise = noise_of(noise);
        let best = grid.best().loss;
        let [mut counts, mut sum, mut variance] = [0.0; 3];
        for cell in &grid.cells {
            let count = cell.runs * valley(cell.loss - best, noise);
            counts += count;
            sum += count * (self.loss.value(&place(cell)) - cell.loss);
            variance += count.powi(2) * noise.powi(2) / cell.runs;
        }
        [sum / counts, variance.sqrt() / counts]
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
