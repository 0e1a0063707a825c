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
    /// Predicted less measured loss, in nats.
    pub loss: f64,
    /// ln of predicted over measured N_nv, or N.
    pub ln_size: f64,
    /// ln of predicted over measured N_v; 0 where N_v is not told apart.
    pub ln_vocab: f64,
    /// ln of predicted over measured D.
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
    /// Degrees of freedom: budgets that forecasts were made from.
    pub dof: usize,
}

impl Score {
    /// None from fewer than two fits.
    pub fn forecast_error(&self) -> Option<ForecastError> {
        let mut fits: Vec<usize> = self.misses.iter().map(|miss| miss.n_fitted).collect();
        fits.dedup();
        let rate = |of: fn(&Miss) -> f64| {
            let squares = self.misses.iter().map(|miss| (of(miss) / miss.factor.ln()).powi(2));
            (squares.sum::<f64>() / self.misses.len() as f64).sqrt()
        };
        (fits.len() >= 2).then(|| ForecastError {
            loss: rate(|miss| miss.loss),
            ln_size: rate(|miss| miss.ln_size),
            ln_vocab: rate(|miss| miss.ln_vocab),
            ln_tokens: rate(|miss| miss.ln_tokens),
            dof: fits.len(),
        })
    }
}
