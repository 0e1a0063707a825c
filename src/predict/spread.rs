//! The part of an interval that grows with the distance from the fit.

use crate::laws::{ForecastError, Laws, Normals};

/// How far a law's forecasts go astray at a distance from its fit, drawn anew for each replicate.
pub(super) struct Spread {
    error: Option<ForecastError>,
    /// ln of the budget over the largest fitted; 0 within the fit.
    distance: f64,
}

/// Replicates that each one of the laws stands for, so that the tails are filled.
const DRAWS: u64 = 20;

impl Spread {
    pub fn at(laws: &Laws, factor: f64) -> Self {
        Self { error: laws.judgement.forecast_error, distance: factor.ln().max(0.0) }
    }

    /// Values moved by the error that `of` names.
    pub fn of(&self, values: impl Iterator<Item = f64>, of: fn(&ForecastError) -> f64) -> Vec<f64> {
        self.moved(values, of, |value, change| value + change)
    }

    /// Positive values moved by an error of their logarithm.
    pub fn of_logs(
        &self,
        values: impl Iterator<Item = f64>,
        of: fn(&ForecastError) -> f64,
    ) -> Vec<f64> {
        self.moved(values, of, |value, change| value * change.exp())
    }

    /// A miss is normal with a deviation that is itself known to few degrees of freedom.
    fn moved(
        &self,
        values: impl Iterator<Item = f64>,
        of: fn(&ForecastError) -> f64,
        apply: impl Fn(f64, f64) -> f64,
    ) -> Vec<f64> {
        let Some(error) = self.error.filter(|_| self.distance > 0.0) else {
            return values.collect();
        };
        let sd = of(&error) * self.distance;
        let mut moved = Vec::new();
        for (i, value) in values.enumerate() {
            let mut normals = Normals::of_stream(0, i as u64);
            for _ in 0..DRAWS {
                let scale = (error.dof as f64 / normals.chi_square(error.dof)).sqrt();
                moved.push(apply(value, sd * scale * normals.next()));
            }
        }
        moved
    }
}
