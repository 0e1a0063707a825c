//! [`ForecastError`]: how a law's misses grow with the distance from its fit.

use serde::{Deserialize, Serialize};

use super::miss::{Deviations, Miss, MissedMinimum};
use crate::laws::joint::above::Off;

/// How a law's misses grow with the distance from its fit: the part of an interval that no noise of
/// the runs holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForecastError {
    /// Standard deviations of its misses for each factor e beyond the fit.
    #[serde(flatten)]
    pub sd: Deviations,
    /// Degrees of freedom: budgets that forecasts were made from, and those of what is expected.
    pub dof: usize,
    /// Budgets that forecasts were made from; 0 where none could be tested.
    #[serde(default)]
    pub tested: usize,
}

/// What is expected before a forecast is tested: a factor ten beyond its fit a law is off by 0.023 nats, and
/// by a seventh in N_nv, N_v and D, beside what the noise of the runs does. It counts as ten budgets,
/// since those of one sweep tell little. Chosen on simulated sweeps, so that intervals ten times beyond
/// the fit hold what they should (`docs/coverage.md`).
pub(in crate::laws) const EXPECTED: ForecastError = ForecastError {
    sd: Deviations { loss: 0.010, ln_size: 0.06, ln_vocab: 0.06, ln_tokens: 0.06 },
    dof: 10,
    tested: 0,
};

impl ForecastError {
    /// The deviation of the loss for each factor e, had it been measured without noise.
    pub(in crate::laws) fn whole<'a>(misses: impl IntoIterator<Item = &'a Miss>) -> Self {
        let noiseless = |miss: &Miss| {
            let loss = Off { measured_to: 0.0, ..miss.loss };
            Miss { loss, ..*miss }
        };
        Self::of(&misses.into_iter().map(noiseless).collect::<Vec<_>>())
    }

    /// Of some misses, drawn towards what is expected.
    ///
    /// A miss of variance r² ln² f + s² holds the law's own, r for each factor e, and that of the measured
    /// loss, s², which does not grow with the distance f: r² is what the squares leave beside s².
    pub(in crate::laws) fn of(misses: &[Miss]) -> Self {
        let of_minimum = |of: fn(&MissedMinimum) -> Off, expected: f64| {
            let off = |miss: &Miss| miss.minimum.as_ref().map(of);
            growth(misses, off, expected)
        };
        let expected = EXPECTED.sd;
        let sd = Deviations {
            loss: growth(misses, |miss| Some(miss.loss), expected.loss),
            ln_size: of_minimum(|minimum| minimum.ln_size, expected.ln_size),
            ln_vocab: of_minimum(|minimum| minimum.ln_vocab, expected.ln_vocab),
            ln_tokens: of_minimum(|minimum| minimum.ln_tokens, expected.ln_tokens),
        };
        let tested = tested(misses);
        Self { sd, dof: tested + EXPECTED.dof, tested }
    }
}

/// How many budgets forecasts were made from.
fn tested(misses: &[Miss]) -> usize {
    misses.chunk_by(|a, b| a.n_fitted == b.n_fitted).count()
}

/// The standard deviation for each factor e of one quantity, where it was tested.
fn growth(misses: &[Miss], off: impl Fn(&Miss) -> Option<Off>, expected: f64) -> f64 {
    let known: Vec<Miss> = misses.iter().filter(|miss| off(miss).is_some()).copied().collect();
    let own: f64 = known.iter().filter_map(&off).map(Off::own_square).sum();
    let distances: f64 = known.iter().map(|miss| miss.factor.ln().powi(2)).sum();
    let seen = if known.is_empty() { 0.0 } else { own.max(0.0) / distances };
    let (tested, prior) = (tested(&known) as f64, EXPECTED.dof as f64);
    ((tested * seen + prior * expected.powi(2)) / (tested + prior)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const E: f64 = std::f64::consts::E;

    fn miss(n_fitted: usize, factor: f64, loss: Off) -> Miss {
        let exact = Off::default();
        let minimum =
            MissedMinimum { loss: loss.by, ln_size: exact, ln_vocab: exact, ln_tokens: exact };
        Miss { n_fitted, share: 1.0, budget_flops: 1.0, factor, loss, minimum: Some(minimum) }
    }

    fn exactly(by: f64) -> Off {
        Off { by, measured_to: 0.0 }
    }

    /// A rate that was seen from `tested` budgets, drawn towards what is expected.
    fn drawn(tested: usize, seen: f64, expected: f64) -> f64 {
        let (tested, prior) = (tested as f64, EXPECTED.dof as f64);
        ((tested * seen.powi(2) + prior * expected.powi(2)) / (tested + prior)).sqrt()
    }

    #[test]
    fn untested_laws_are_expected_to_miss() {
        assert_eq!(ForecastError::of(&[]), EXPECTED);
    }

    #[test]
    fn misses_are_weighed_against_what_is_expected() {
        let misses = [(2, E, 0.06), (2, E * E, 0.12), (3, E, 0.06)];
        let misses = misses.map(|(n, factor, by)| miss(n, factor, exactly(by)));
        let found = ForecastError::of(&misses);
        assert_eq!((found.tested, found.dof), (2, 2 + EXPECTED.dof));
        assert!((found.sd.loss - drawn(2, 0.06, EXPECTED.sd.loss)).abs() < 1e-12, "{found:?}");
        assert!((found.sd.ln_size - drawn(2, 0.0, EXPECTED.sd.ln_size)).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn a_doubtful_minimum_tests_the_loss_alone() {
        let doubtful = Miss { minimum: None, ..miss(2, E, exactly(0.06)) };
        let found = ForecastError::of(&[doubtful]);
        assert!((found.sd.loss - drawn(1, 0.06, EXPECTED.sd.loss)).abs() < 1e-12, "{found:?}");
        assert_eq!((found.sd.ln_size, found.tested), (EXPECTED.sd.ln_size, 1));
    }

    #[test]
    fn what_a_minimum_is_measured_to_is_not_the_laws_miss() {
        let seen = |by| ForecastError::of(&[miss(2, E, Off { by, measured_to: 0.03 })]).sd.loss;
        let of = |own: f64| drawn(1, own, EXPECTED.sd.loss);
        assert!((seen(0.05) - of(0.04)).abs() < 1e-12, "{}", seen(0.05));
        assert!((seen(0.02) - of(0.0)).abs() < 1e-12, "{}", seen(0.02));
    }
}
