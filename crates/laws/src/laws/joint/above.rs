//! How far a joint law lies from cells that it may not have seen.

use super::JointLaw;
use super::problem::noise_of;
use super::weighed::{place, valley};
use crate::laws::minima::grid::Grid;
use crate::laws::minima::run_noise::RunNoise;
use serde::{Deserialize, Serialize};

/// Predicted less measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Off {
    pub by: f64,
    /// The standard deviation of what was measured; 0 where it is not known.
    pub measured_to: f64,
}

impl Off {
    /// The square of what is the law's own.
    pub(in crate::laws) fn own_square(self) -> f64 {
        self.by.powi(2) - self.measured_to.powi(2)
    }
}

/// How far a law lies above the cells of a budget: the mean over its valley, and the standard deviation
/// that the noise of the runs gives this mean, in nats.
pub(in crate::laws) fn above(law: &JointLaw, grid: &Grid, noise: Option<RunNoise>) -> Off {
    let noise = noise_of(noise);
    let best = grid.best().loss;
    let [mut counts, mut sum, mut variance] = [0.0; 3];
    for cell in &grid.cells {
        let count = cell.runs * valley(cell.loss - best, noise);
        counts += count;
        sum += count * (law.loss.value(&place(cell)) - cell.loss);
        variance += count.powi(2) * noise.powi(2) / cell.runs;
    }
    Off { by: sum / counts, measured_to: variance.sqrt() / counts }
}
