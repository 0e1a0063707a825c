//! The values between a table of runs and a law; [`Laws`] is what `laws.json` holds.

use super::advice::Advice;
use super::answer::Answer;
use super::judgement::Judgement;
use super::kind::LawKind;
use crate::laws::input::metric::Metric;
use crate::laws::input::point::Parameters;
use crate::laws::joint::law::JointLaw;
use crate::laws::lines::sample::LawSample;
use crate::laws::lines::types::Validation;
use crate::laws::minima::run_noise::RunNoise;
use crate::laws::parametric::types::Parametric;
use crate::laws::ranking::recommended::Candidate;
use serde::{Deserialize, Serialize};

use crate::laws::input::method::MinimumMethod;
use crate::laws::lines::types::{Exponents, LossLaws, PowerLaw, PowerLaws, Sensitivity};
use crate::laws::minima::types::Minimum;

/// The budget that laws through the others were tested on, and what was measured there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    pub budget_flops: f64,
    /// The minimum measured there, by the method that the laws use.
    pub minimum: Minimum,
    /// Of the laws through the minima of the other budgets.
    #[serde(default)]
    pub exponents: Exponents,
}

/// Every fit of a sweep, with the convention used: `laws.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Laws {
    /// Name of the sweep or table, or `scamo` for the built-in law.
    pub name: String,
    #[serde(default)]
    pub law: LawKind,
    /// Whether the laws speak of this project's own models, so that a shape and a codebook can be
    /// named; not so for a table of runs made elsewhere.
    #[serde(default)]
    pub from_sweep: bool,
    /// `openai`, `6nd` or `exact`: which count of FLOPs the laws are written in.
    pub flops_rule: String,
    /// The loss that the points hold.
    #[serde(default)]
    pub metric: Metric,
    /// Whether N_nv and N_v are told apart.
    #[serde(default)]
    pub parameters: Parameters,
    /// n_ctx of the sweep's models, for the `openai` count of a prediction; absent where unknown.
    #[serde(default)]
    pub n_ctx: Option<usize>,
    /// The share of the vocabulary that a code is chosen among, on the mean, for the same count: below
    /// 1 where each scale has a head of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub head_share: Option<f64>,
    /// Whether vocabularies are the trainer's own: any V, and no levels of FSQ.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub own_vocabularies: bool,
    /// C0, the geometric mean of the fitted budgets.
    pub reference_flops: f64,
    /// The budgets whose minima the laws were fitted to, ascending: not the flagged ones, unless they were
    /// kept or too few are left. Empty for a published law.
    pub fitted_budgets: Vec<f64>,
    /// The kind of minimum that the laws were fitted to.
    pub minima_method: MinimumMethod,
    /// Every minimum by every method asked for, flagged ones too.
    pub minima: Vec<Minimum>,
    pub held_out: Option<HeldOut>,
    pub power_laws: PowerLaws,
    /// N_v in N_nv (ScaMo Eq. 10).
    pub vocab_from_nonvocab: Option<PowerLaw>,
    pub loss: LossLaws,
    /// The parametric loss, where the laws come from one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parametric: Option<Parametric>,
    pub sensitivity: Vec<Sensitivity>,
    /// Budgets predicted by laws that had not seen them.
    #[serde(default)]
    pub validation: Vec<Validation>,
    /// What to run next.
    #[serde(default)]
    pub advice: Vec<Advice>,
    /// The scatter of single runs that the bootstrap draws from; absent where it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<RunNoise>,
    /// Replicates of the bootstrap: each holds the coefficients of one, for intervals.
    pub bootstrap: Vec<LawSample>,
    /// Sentences for a person: what was left out, what is not identified.
    pub warnings: Vec<String>,
    /// Which law to believe, and how far.
    #[serde(flatten)]
    pub judgement: Judgement,
    /// What screen, figures, report and files say of the laws; absent in an older file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answer: Option<Answer>,
}

impl Laws {
    /// Laws that hold nothing yet, around C0 = `reference_flops`.
    pub fn unfitted(
        law: LawKind,
        (name, flops_rule): (&str, &str),
        parameters: Parameters,
        reference_flops: f64,
    ) -> Self {
        Self {
            name: name.to_string(),
            law,
            flops_rule: flops_rule.to_string(),
            parameters,
            reference_flops,
            ..Self::default()
        }
    }

    /// The smallest and the largest budget that they rest on; C0 for a published law.
    pub fn range(&self) -> [f64; 2] {
        let tried = self.judgement.tried.map(|tried| tried.budgets).filter(|[low, _]| *low > 0.0);
        let used = || Some([*self.fitted_budgets.first()?, *self.fitted_budgets.last()?]);
        tried.or_else(used).unwrap_or([self.reference_flops; 2])
    }

    /// The one V that all runs have; `None` where several were tried or none is known.
    pub fn only_vocabulary(&self) -> Option<f64> {
        let [low, high] = self.judgement.tried?.vocabularies;
        (low == high && low > 0.0).then_some(low)
    }

    /// The law to believe; the log law where none was ranked.
    pub fn recommended_law(&self) -> Candidate {
        self.judgement.recommended.as_ref().map_or(Candidate::Log, |recommended| recommended.law)
    }

    /// The joint law, if it is the one to believe.
    pub fn joint_law(&self) -> Option<&JointLaw> {
        self.judgement.joint.as_ref().filter(|_| self.recommended_law().is_joint())
    }

    /// The minima of the kind that the laws of minima go through.
    pub fn own_minima(&self) -> impl Iterator<Item = &Minimum> {
        self.minima.iter().filter(|minimum| minimum.method == self.minima_method)
    }

    /// The loss of the best model at `budget` by a law of minima; `None` of a joint law, or if there is no such law.
    pub fn loss_of_minima(&self, law: Candidate, budget: f64) -> Option<f64> {
        match law {
            Candidate::Log => Some(self.loss.log.as_ref()?.loss_at(budget)),
            Candidate::Floor => {
                Some(self.loss.floor.as_ref()?.loss_at(budget, self.reference_flops))
            }
            Candidate::Joint | Candidate::JointRepeats => None,
        }
    }

    /// What the loss is called: L_u in a sweep, L in a table whose loss may be any.
    pub fn loss_symbol(&self) -> &'static str {
        if self.from_sweep { "L_u" } else { "L" }
    }
}
