//! The part of an interval that grows with the distance from the fit.

use super::opinion::Opinion;
use crate::laws::{Belief, Deviations, Normals};

/// How far forecasts go astray at a distance from their fit, drawn anew for each replicate: which law is
/// right, and how far it misses.
pub(super) struct Spread {
    opinions: Vec<Opinion>,
    /// ln of the budget over the largest fitted; 0 within the fit.
    distance: f64,
}

/// Replicates that each one of the laws stands for, so that the tails are filled.
const DRAWS: u64 = 20;

impl Spread {
    /// At `factor` times the largest fitted budget.
    pub fn new(opinions: Vec<Opinion>, factor: f64) -> Self {
        Self { opinions, distance: factor.ln().max(0.0) }
    }

    /// Values moved by the quantity that `of` names.
    pub fn of(&self, values: impl Iterator<Item = f64>, of: fn(&Deviations) -> f64) -> Vec<f64> {
        self.moved(values, of, |value, change| value + change)
    }

    /// Positive values, whose logarithms are moved.
    pub fn of_logs(
        &self,
        values: impl Iterator<Item = f64>,
        of: fn(&Deviations) -> f64,
    ) -> Vec<f64> {
        self.moved(values, of, |value, change| value * change.exp())
    }

    fn moved(
        &self,
        values: impl Iterator<Item = f64>,
        of: fn(&Deviations) -> f64,
        apply: impl Fn(f64, f64) -> f64,
    ) -> Vec<f64> {
        if self.opinions.is_empty() || self.distance == 0.0 {
            return values.collect();
        }
        let mut moved = Vec::new();
        for (i, value) in values.enumerate() {
            let mut normals = Normals::of_stream(0, i as u64);
            moved.extend((0..DRAWS).map(|_| apply(value, self.change(&mut normals, of))));
        }
        moved
    }

    /// A law by its weight, and a miss of it: normal, with a deviation that is itself known to few
    /// degrees of freedom.
    fn change(&self, normals: &mut Normals, of: fn(&Deviations) -> f64) -> f64 {
        let Opinion { shift, belief: Belief { error, .. } } = self.drawn(normals.uniform());
        let scale = (error.dof as f64 / normals.chi_square(error.dof)).sqrt();
        of(shift) + of(&error.sd) * self.distance * scale * normals.draw()
    }

    fn drawn(&self, mut share: f64) -> &Opinion {
        let mut opinions = self.opinions.iter();
        let last = &self.opinions[self.opinions.len() - 1];
        opinions
            .find(|opinion| {
                share -= opinion.belief.weight;
                share < 0.0
            })
            .unwrap_or(last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{Candidate, ForecastError};

    fn opinion(weight: f64, loss: f64) -> Opinion {
        let shift = Deviations { loss, ..Deviations::default() };
        let error = ForecastError { sd: Deviations::default(), dof: 4, tested: 0 };
        Opinion { belief: Belief { law: Candidate::Log, weight, error }, shift }
    }

    #[test]
    fn each_law_moves_its_share_of_the_values() {
        let spread = Spread::new(vec![opinion(0.75, 0.0), opinion(0.25, 1.0)], 10.0);
        let moved = spread.of((0..500).map(|_| -3.0), |q| q.loss);
        let above = moved.iter().filter(|value| **value == -2.0).count() as f64;
        assert!(moved.iter().all(|value| [-3.0, -2.0].contains(value)));
        assert!((above / moved.len() as f64 - 0.25).abs() < 0.02, "{above}");
    }

    #[test]
    fn nothing_moves_within_the_fit() {
        let spread = Spread::new(vec![opinion(1.0, 1.0)], 0.5);
        assert_eq!(spread.of([-3.0].into_iter(), |q| q.loss), [-3.0]);
    }
}
