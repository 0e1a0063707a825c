//! The recommended law and its errors, as stored in `laws.json`.

use serde::{Deserialize, Serialize};

use crate::laws::input::MinimumMethod;
use crate::laws::joint::{JointLaw, Off};

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
    /// The same, with less worth for repeated data.
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

    /// Its name in sentences.
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

impl JointLaw {
    /// Its name among the laws that can be recommended.
    pub fn candidate(&self) -> Candidate {
        if self.loss.terms.repeats { Candidate::JointRepeats } else { Candidate::Joint }
    }
}

/// How a candidate did on budgets that it had not seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    pub law: Candidate,
    /// Root mean square of the misses of the loss that are compared, in nats.
    pub rms: f64,
    /// By the number of budgets fitted, then by budget.
    pub misses: Vec<Miss>,
}

impl Score {
    /// The errors by which laws are compared: on unflagged minima, which test every law; all errors if there are none.
    pub fn compared(&self) -> impl Iterator<Item = &Miss> {
        let any = self.misses.iter().any(|miss| miss.minimum.is_some());
        self.misses.iter().filter(move |miss| !any || miss.minimum.is_some())
    }
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
    /// The unit of the loss per nat, if it is not L_u.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub loss_unit: f64,
}

/// The weight of a tested law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    pub law: Candidate,
    /// Above 0; all weights sum to 1.
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
            let error = ForecastError::of(&score.misses, self.loss_unit);
            let whole = ForecastError::whole(score.compared(), self.loss_unit);
            let expected = EXPECTED.sd.loss * self.loss_unit;
            let weight = (whole.sd.loss / expected).powi(-(whole.dof as i32));
            Belief { law: score.law, weight, error }
        };
        let mut beliefs: Vec<Belief> = self.scores.iter().map(of).collect();
        let sum: f64 = beliefs.iter().map(|belief| belief.weight).sum();
        beliefs.iter_mut().for_each(|belief| belief.weight /= sum);
        beliefs
    }
}

// Misses, and how they grow with the distance from a fit.

/// A forecast of one budget of a sweep, against its measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Miss {
    /// The number of budgets fitted.
    pub n_fitted: usize,
    /// The share of the data of the budget's runs, relative to the sweep's largest.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub share: f64,
    pub budget_flops: f64,
    /// The budget over the largest that was fitted.
    pub factor: f64,
    /// Loss error in nats: at the budget's minimum, or, for a joint law of several vocabularies, the mean over
    /// the cells near the minimum.
    pub loss: Off,
    /// The error at the minimum; `None` if it is flagged, or if smaller budgets have too few unflagged minima for a law.
    /// Then only a joint law is tested.
    pub minimum: Option<MissedMinimum>,
}

fn one() -> f64 {
    1.0
}

fn is_one(value: &f64) -> bool {
    *value == 1.0
}

/// A value for the loss, and one for the logarithm of each part of an allocation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Deviations<T = f64> {
    /// In nats.
    pub loss: f64,
    /// The error of ln N_nv, or ln N.
    pub ln_size: T,
    /// The error of ln N_v; 0 if N_v is not separate.
    pub ln_vocab: T,
    /// The error of ln D.
    pub ln_tokens: T,
}

/// Predicted less measured minimum.
pub type MissedMinimum = Deviations<Off>;

/// How a law's misses grow with the distance from its fit: the part of an interval that no noise of
/// the runs holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForecastError {
    /// Standard deviations of its misses for each factor e beyond the fit.
    #[serde(flatten)]
    pub sd: Deviations,
    /// Degrees of freedom: the budgets behind forecasts, plus those of the prior.
    pub dof: usize,
    /// Budgets that forecasts were made from; 0 if none could be tested.
    #[serde(default)]
    pub tested: usize,
}

/// The prior error of a law: ten times beyond its fit, 0.023 nats, and a seventh in N_nv, N_v and D, in addition to
/// run noise. It counts as ten budgets, since the budgets of one sweep say little. Chosen on simulated sweeps so that
/// intervals ten times beyond the fit have the right coverage (`docs/coverage.md`).
const EXPECTED: ForecastError = ForecastError {
    sd: Deviations { loss: 0.010, ln_size: 0.06, ln_vocab: 0.06, ln_tokens: 0.06 },
    dof: 10,
    tested: 0,
};

impl ForecastError {
    /// The deviation of the loss for each factor e, had it been measured without noise.
    pub(in crate::laws) fn whole<'a>(
        misses: impl IntoIterator<Item = &'a Miss>,
        loss_unit: f64,
    ) -> Self {
        let noiseless = |miss: &Miss| {
            let loss = Off { measured_to: 0.0, ..miss.loss };
            Miss { loss, ..*miss }
        };
        Self::of(&misses.into_iter().map(noiseless).collect::<Vec<_>>(), loss_unit)
    }

    /// Estimates the growth from some errors, shrunk towards the prior; `loss_unit` is the loss per nat.
    ///
    /// An error has the variance r² ln² f + s²: r per factor e from the law, and s² from the measured loss, which does not
    /// grow with the distance f. r² is estimated from the squares minus s².
    pub(in crate::laws) fn of(misses: &[Miss], loss_unit: f64) -> Self {
        let of_minimum = |of: fn(&MissedMinimum) -> Off, expected: f64| {
            let off = |miss: &Miss| miss.minimum.as_ref().map(of);
            growth(misses, off, expected)
        };
        let expected = EXPECTED.sd;
        let sd = Deviations {
            loss: growth(misses, |miss| Some(miss.loss), expected.loss * loss_unit),
            ln_size: of_minimum(|minimum| minimum.ln_size, expected.ln_size),
            ln_vocab: of_minimum(|minimum| minimum.ln_vocab, expected.ln_vocab),
            ln_tokens: of_minimum(|minimum| minimum.ln_tokens, expected.ln_tokens),
        };
        let tested = tested(misses);
        Self { sd, dof: tested + EXPECTED.dof, tested }
    }
}

/// The number of budgets behind forecasts.
fn tested(misses: &[Miss]) -> usize {
    misses.chunk_by(|a, b| a.n_fitted == b.n_fitted).count()
}

/// The standard deviation per factor e of one quantity, if it was tested.
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

    fn missed(budget_flops: f64, by: f64, measured_to: f64) -> Miss {
        Miss { budget_flops, ..miss(3, 2.0, Off { by, measured_to }) }
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
        assert_eq!(ForecastError::of(&[], 1.0), EXPECTED);
    }

    #[test]
    fn misses_are_weighed_against_what_is_expected() {
        let misses = [(2, E, 0.06), (2, E * E, 0.12), (3, E, 0.06)];
        let misses = misses.map(|(n, factor, by)| miss(n, factor, exactly(by)));
        let found = ForecastError::of(&misses, 1.0);
        assert_eq!((found.tested, found.dof), (2, 2 + EXPECTED.dof));
        assert!((found.sd.loss - drawn(2, 0.06, EXPECTED.sd.loss)).abs() < 1e-12, "{found:?}");
        assert!((found.sd.ln_size - drawn(2, 0.0, EXPECTED.sd.ln_size)).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn a_doubtful_minimum_tests_the_loss_alone() {
        let doubtful = Miss { minimum: None, ..miss(2, E, exactly(0.06)) };
        let found = ForecastError::of(&[doubtful], 1.0);
        assert!((found.sd.loss - drawn(1, 0.06, EXPECTED.sd.loss)).abs() < 1e-12, "{found:?}");
        assert_eq!((found.sd.ln_size, found.tested), (EXPECTED.sd.ln_size, 1));
    }

    #[test]
    fn what_a_minimum_is_measured_to_is_not_the_laws_miss() {
        let seen =
            |by| ForecastError::of(&[miss(2, E, Off { by, measured_to: 0.03 })], 1.0).sd.loss;
        let of = |own: f64| drawn(1, own, EXPECTED.sd.loss);
        assert!((seen(0.05) - of(0.04)).abs() < 1e-12, "{}", seen(0.05));
        assert!((seen(0.02) - of(0.0)).abs() < 1e-12, "{}", seen(0.02));
    }

    fn score(law: Candidate, misses: Vec<Miss>) -> Score {
        Score { law, rms: 0.05, misses }
    }

    fn weights(scores: Vec<Score>) -> Vec<f64> {
        let recommended = Recommended {
            law: Candidate::Joint,
            minima_method: MinimumMethod::Parabola,
            why: String::new(),
            scores,
            loss_unit: 1.0,
        };
        recommended.beliefs().iter().map(|belief| belief.weight).collect()
    }

    #[test]
    fn of_laws_that_miss_alike_none_is_believed_for_its_noise() {
        let exact = score(Candidate::Joint, vec![missed(1e10, 0.05, 0.0)]);
        let noisy = score(Candidate::Log, vec![missed(1e10, 0.05, 0.05)]);
        assert_eq!(weights(vec![exact, noisy]), [0.5, 0.5]);
    }

    #[test]
    fn laws_are_weighed_where_all_were_tested() {
        let doubtful = Miss { minimum: None, ..missed(2e10, 0.5, 0.0) };
        let joint = score(Candidate::Joint, vec![missed(1e10, 0.05, 0.0), doubtful]);
        let log = score(Candidate::Log, vec![missed(1e10, 0.05, 0.0)]);
        assert_eq!(weights(vec![joint.clone(), log]), [0.5, 0.5]);
        assert_eq!(weights(vec![joint]), [1.0]);
    }
}
