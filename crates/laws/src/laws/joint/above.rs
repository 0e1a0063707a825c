//! How far a joint law lies from cells that it may not have seen.

use super::JointLaw;
use super::problem::noise_of;
use super::weighed::{place, valley};
use crate::laws::minima::Grid;
use crate::laws::{Off, RunNoise};

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
