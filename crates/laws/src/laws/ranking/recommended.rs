//! Which law predicts, and by how much it missed: what `laws.json` holds of it.

use serde::{Deserialize, Serialize};

use crate::laws::joint::law::JointLaw;

use super::forecast_error::{EXPECTED, ForecastError};
use super::miss::Miss;
use crate::laws::input::method::MinimumMethod;

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
    /// The misses by which laws are compared: those of minima beyond doubt, which every law is tested by; all
    /// where there are none.
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
            let whole = ForecastError::whole(score.compared());
            let weight = (whole.sd.loss / EXPECTED.sd.loss).powi(-(whole.dof as i32));
            Belief { law: score.law, weight, error }
        };
        let beliefs = self.scores.iter().map(of);
        let mut beliefs: Vec<Belief> = beliefs.collect();
        let sum: f64 = beliefs.iter().map(|belief| belief.weight).sum();
        beliefs.iter_mut().for_each(|belief| belief.weight /= sum);
        beliefs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::joint::above::Off;
    use crate::laws::ranking::miss::MissedMinimum;

    fn score(law: Candidate, misses: Vec<Miss>) -> Score {
        Score { law, rms: 0.05, misses }
    }

    fn miss(budget_flops: f64, by: f64, measured_to: f64) -> Miss {
        let exact = Off::default();
        let minimum = MissedMinimum { loss: by, ln_size: exact, ln_vocab: exact, ln_tokens: exact };
        let loss = Off { by, measured_to };
        Miss { n_fitted: 3, share: 1.0, budget_flops, factor: 2.0, loss, minimum: Some(minimum) }
    }

    fn weights(scores: Vec<Score>) -> Vec<f64> {
        let recommended = Recommended {
            law: Candidate::Joint,
            minima_method: MinimumMethod::Parabola,
            why: String::new(),
            scores,
        };
        recommended.beliefs().iter().map(|belief| belief.weight).collect()
    }

    #[test]
    fn of_laws_that_miss_alike_none_is_believed_for_its_noise() {
        let exact = score(Candidate::Joint, vec![miss(1e10, 0.05, 0.0)]);
        let noisy = score(Candidate::Log, vec![miss(1e10, 0.05, 0.05)]);
        assert_eq!(weights(vec![exact, noisy]), [0.5, 0.5]);
    }

    #[test]
    fn laws_are_weighed_where_all_were_tested() {
        let doubtful = Miss { minimum: None, ..miss(2e10, 0.5, 0.0) };
        let joint = score(Candidate::Joint, vec![miss(1e10, 0.05, 0.0), doubtful]);
        let log = score(Candidate::Log, vec![miss(1e10, 0.05, 0.0)]);
        assert_eq!(weights(vec![joint.clone(), log]), [0.5, 0.5]);
        assert_eq!(weights(vec![joint]), [1.0]);
    }
}
