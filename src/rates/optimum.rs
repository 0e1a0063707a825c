//! The best rate of a cell.

use serde::{Deserialize, Serialize};

use super::Place;
use super::trial::rate_factor;

/// What the trials of a cell say of its rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellRate {
    #[serde(flatten)]
    pub place: Place,
    /// The best rate that was tried, and L_u there.
    pub best_lr: f64,
    pub best_loss: f64,
    /// The rate at the bottom of the parabola in ln lr through it and the rates on both sides.
    pub optimal_lr: f64,
    /// Nats that a factor e from there costs; none where a rate beside it diverged.
    pub nats_per_ln2: Option<f64>,
    /// L_u at the sweep's own rate.
    pub own_loss: Option<f64>,
    /// Trials at the sweep's own batch and schedule.
    pub trials: usize,
}

impl CellRate {
    /// Of the rates that were tried, ascending factors of √2 with their losses; none where all of them
    /// diverged.
    pub(super) fn of(place: Place, rates: &[(i32, f64)]) -> Option<Self> {
        let lr = |rate: i32| place.lr * rate_factor(rate);
        let tried: Vec<(f64, f64)> = rates.iter().map(|(rate, loss)| (lr(*rate), *loss)).collect();
        let best = (0..tried.len()).min_by(|a, b| tried[*a].1.total_cmp(&tried[*b].1))?;
        let (best_lr, best_loss) = tried[best];
        let beside = |i: Option<usize>| i.and_then(|i| tried.get(i)).copied();
        let (optimal_lr, nats_per_ln2) =
            vertex(beside(best.checked_sub(1)), tried[best], beside(best.checked_add(1)));
        let own = rates.iter().find(|(rate, _)| *rate == 0).map(|(_, loss)| *loss);
        best_loss.is_finite().then_some(Self {
            place,
            best_lr,
            best_loss,
            optimal_lr,
            nats_per_ln2,
            own_loss: own.filter(|loss| loss.is_finite()),
            trials: tried.len(),
        })
    }

    /// How much worse than its best the cell is at another rate, in nats, by its parabola.
    pub fn regret(&self, lr: f64) -> Option<f64> {
        Some(self.nats_per_ln2? * (lr / self.optimal_lr).ln().powi(2))
    }
}

/// The rate at the bottom of a parabola in ln rate, and its leading coefficient.
///
/// Beside a rate that diverged, or was not tried, the bottom is put half a step towards the other side.
fn vertex(
    below: Option<(f64, f64)>,
    best: (f64, f64),
    above: Option<(f64, f64)>,
) -> (f64, Option<f64>) {
    let finite = |point: Option<(f64, f64)>| point.filter(|(_, loss)| loss.is_finite());
    let ln = |lr: f64| (lr / best.0).ln();
    match (finite(below), finite(above)) {
        (Some((low, left)), Some((high, right))) => {
            let (a, b) = (ln(low), ln(high));
            let (rise_a, rise_b) = ((left - best.1) / a, (right - best.1) / b);
            let curvature = (rise_b - rise_a) / (b - a);
            if curvature <= 0.0 {
                return (best.0, None);
            }
            let slope = rise_a - curvature * a;
            let at = (-slope / (2.0 * curvature)).clamp(a, b);
            (best.0 * at.exp(), Some(curvature))
        }
        (Some((low, _)), None) if above.is_some() => (best.0 * (ln(low) / 4.0).exp(), None),
        _ => (best.0, None),
    }
}
