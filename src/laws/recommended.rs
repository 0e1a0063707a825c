//! Which law predicts, and by how much it missed: what `laws.json` holds of it.

use serde::{Deserialize, Serialize};

use crate::sweep::MinimumMethod;

/// A law that can be recommended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Candidate {
    /// Power laws through the minima; the loss a line in ln C (ScaMo).
    Log,
    /// Power laws through the minima; the loss a power of C above a floor.
    Floor,
    /// One smooth loss over all cells.
    Joint,
    /// The same, with data worth less when it is repeated.
    JointRepeats,
}

impl Candidate {
    /// Simpler ones first.
    pub const ALL: [Self; 4] = [Self::Log, Self::Floor, Self::Joint, Self::JointRepeats];

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Log => "log",
            Self::Floor => "floor",
            Self::Joint => "joint",
            Self::JointRepeats => "joint-repeats",
        }
    }

    /// What it is, for a person.
    pub fn about(self) -> &'static str {
        match self {
            Self::Log => "the log law",
            Self::Floor => "the law with a floor",
            Self::Joint => "the joint law",
            Self::JointRepeats => "the joint law with repetition",
        }
    }

    /// Whether it is a joint law.
    pub fn is_joint(self) -> bool {
        matches!(self, Self::Joint | Self::JointRepeats)
    }
}

/// What a law that saw smaller budgets alone said of a budget, less what was measured there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Miss {
    /// How many budgets the law was fitted to.
    pub n_fitted: usize,
    pub budget_flops: f64,
    /// The budget over the largest that was fitted.
    pub factor: f64,
    /// Predicted less measured loss, in nats: that of the minimum, or, of a joint law, which says something
    /// of every cell, the mean over the cells of the budget's valley.
    pub loss: f64,
    /// Predicted less measured loss of the minimum, in nats.
    #[serde(default)]
    pub of_minimum: f64,
    /// ln of predicted over measured N_nv, or N.
    pub ln_size: f64,
    /// ln of predicted over measured N_v; 0 where N_v is not told apart.
    pub ln_vocab: f64,
    /// ln of predicted over measured D.
    pub ln_tokens: f64,
    /// How precisely the minimum was measured.
    #[serde(default)]
    pub measured_to: MeasuredTo,
}

/// Standard deviations of a measured minimum; 0 where they are not known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredTo {
    /// In nats.
    pub loss: f64,
    /// Of ln N_nv, ln N_v and ln D.
    pub ln_size: f64,
    pub ln_vocab: f64,
    pub ln_tokens: f64,
}

/// How a candidate did on budgets that it had not seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    pub law: Candidate,
    /// Root mean square of the misses of the loss, in nats.
    pub rms: f64,
    pub misses: Vec<Miss>,
}

/// The law to believe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recommended {
    pub law: Candidate,
    pub minima_method: MinimumMethod,
    /// The reason, for a person.
    pub why: String,
    /// Every law that could be tested, the best first.
    pub scores: Vec<Score>,
}

/// How far a law that was tested is believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    pub law: Candidate,
    /// Above 0; those of all laws sum to 1.
    pub weight: f64,
    pub error: ForecastError,
}

impl Recommended {
    /// Every tested law by how probable its own misses make it.
    ///
    /// Misses are normal with a deviation that is known to few degrees of freedom ν, so that a law whose
    /// misses are twice as large is 2^ν times less believed, not ruled out. They are taken whole: a law
    /// whose misses may all be noise of the minima is not the better for it.
    pub fn beliefs(&self) -> Vec<Belief> {
        let of = |score: &Score| {
            let error = ForecastError::of(&score.misses);
            let ratio = ForecastError::whole(&score.misses) / EXPECTED.loss;
            let weight = ratio.powi(-(error.dof as i32));
            Belief { law: score.law, weight, error }
        };
        let beliefs = self.scores.iter().map(of);
        let mut beliefs: Vec<Belief> = beliefs.collect();
        let sum: f64 = beliefs.iter().map(|belief| belief.weight).sum();
        beliefs.iter_mut().for_each(|belief| belief.weight /= sum);
        beliefs
    }
}

/// How a law's misses grow with the distance from its fit: the part of an interval that no noise of
/// the runs holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForecastError {
    /// Standard deviation of the loss's miss, in nats for each factor e beyond the fit.
    pub loss: f64,
    /// Of ln N_nv, ln N_v and ln D, likewise.
    pub ln_size: f64,
    pub ln_vocab: f64,
    pub ln_tokens: f64,
    /// Degrees of freedom: budgets that forecasts were made from, and those of what is expected.
    pub dof: usize,
    /// Budgets that forecasts were made from; 0 where none could be tested.
    #[serde(default)]
    pub tested: usize,
}

/// What is expected before a forecast is tested: a factor ten beyond its fit a law is off by 0.03 nats, and
/// by a seventh in N_nv, N_v and D, beside what the noise of the runs does. It counts as ten budgets,
/// since those of one sweep tell little. Chosen on simulated sweeps, so that intervals ten times beyond
/// the fit hold what they should (`docs/coverage.md`).
const EXPECTED: ForecastError = ForecastError {
    loss: 0.012,
    ln_size: 0.06,
    ln_vocab: 0.06,
    ln_tokens: 0.06,
    dof: 10,
    tested: 0,
};

impl ForecastError {
    /// The deviation of the loss for each factor e, had the minima been measured without noise.
    fn whole(misses: &[Miss]) -> f64 {
        let noiseless = |miss: &Miss| Miss { measured_to: MeasuredTo::default(), ..*miss };
        Self::of(&misses.iter().map(noiseless).collect::<Vec<_>>()).loss
    }

    /// Of some misses, drawn towards what is expected.
    ///
    /// A miss of variance r² ln² f + s² holds the law's own, r for each factor e, and that of the measured
    /// minimum, s², which does not grow with the distance f: r² is what the squares leave beside s².
    pub(super) fn of(misses: &[Miss]) -> Self {
        if misses.is_empty() {
            return EXPECTED;
        }
        let mut fits: Vec<usize> = misses.iter().map(|miss| miss.n_fitted).collect();
        fits.dedup();
        let (tested, dof) = (fits.len(), fits.len() + EXPECTED.dof);
        let distances: f64 = misses.iter().map(|miss| miss.factor.ln().powi(2)).sum();
        let rate = |of: fn(&Miss) -> f64, to: fn(&MeasuredTo) -> f64, expected: f64| {
            let own = misses.iter().map(|miss| of(miss).powi(2) - to(&miss.measured_to).powi(2));
            let seen = own.sum::<f64>().max(0.0) / distances;
            let weighed = tested as f64 * seen + EXPECTED.dof as f64 * expected.powi(2);
            (weighed / dof as f64).sqrt()
        };
        Self {
            loss: rate(|miss| miss.loss, |to| to.loss, EXPECTED.loss),
            ln_size: rate(|miss| miss.ln_size, |to| to.ln_size, EXPECTED.ln_size),
            ln_vocab: rate(|miss| miss.ln_vocab, |to| to.ln_vocab, EXPECTED.ln_vocab),
            ln_tokens: rate(|miss| miss.ln_tokens, |to| to.ln_tokens, EXPECTED.ln_tokens),
            dof,
            tested,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn miss(n_fitted: usize, factor: f64, loss: f64) -> Miss {
        Miss {
            n_fitted,
            budget_flops: 1.0,
            factor,
            loss,
            of_minimum: loss,
            ln_size: 0.0,
            ln_vocab: 0.0,
            ln_tokens: 0.0,
            measured_to: MeasuredTo::default(),
        }
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
        let e = std::f64::consts::E;
        let found = ForecastError::of(&[miss(2, e, 0.06), miss(2, e * e, 0.12), miss(3, e, 0.06)]);
        assert_eq!((found.tested, found.dof), (2, 2 + EXPECTED.dof));
        assert!((found.loss - drawn(2, 0.06, EXPECTED.loss)).abs() < 1e-12, "{found:?}");
        assert!((found.ln_size - drawn(2, 0.0, EXPECTED.ln_size)).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn of_laws_that_miss_alike_none_is_believed_for_its_noise() {
        let measured_to = MeasuredTo { loss: 0.05, ..MeasuredTo::default() };
        let score = |law, measured_to| {
            let misses = vec![Miss { measured_to, ..miss(2, 2.0, 0.05) }];
            Score { law, rms: 0.05, misses }
        };
        let recommended = Recommended {
            law: Candidate::Joint,
            minima_method: MinimumMethod::Parabola,
            why: String::new(),
            scores: vec![
                score(Candidate::Joint, MeasuredTo::default()),
                score(Candidate::Log, measured_to),
            ],
        };
        let weights: Vec<f64> = recommended.beliefs().iter().map(|belief| belief.weight).collect();
        assert_eq!(weights, [0.5, 0.5]);
    }

    #[test]
    fn what_a_minimum_is_measured_to_is_not_the_laws_miss() {
        let e = std::f64::consts::E;
        let measured_to = MeasuredTo { loss: 0.03, ..MeasuredTo::default() };
        let seen = |loss| ForecastError::of(&[Miss { measured_to, ..miss(2, e, loss) }]).loss;
        let of = |own: f64| drawn(1, own, EXPECTED.loss);
        assert!((seen(0.05) - of(0.04)).abs() < 1e-12, "{}", seen(0.05));
        assert!((seen(0.02) - of(0.0)).abs() < 1e-12, "{}", seen(0.02));
    }
}
