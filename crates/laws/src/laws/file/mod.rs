//! The contents of `laws.json`: [`Laws`], their [`Answer`], and in `judgement` their reliability.

mod judgement;

pub use judgement::{Inside, IntervalPart, Judgement, Measured, Predicted, Tried, Validated};

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use crate::laws::input::{Metric, MinimumMethod, Parameters, PerQuantity};
use crate::laws::joint::JointLaw;
use crate::laws::lines::{
    Exponents, LawSample, LossLaws, PowerLaw, PowerLaws, Sensitivity, Validation,
};
use crate::laws::minima::{Minimum, RunNoise};
use crate::laws::parametric::{Form, Parametric};
use crate::laws::ranking::Candidate;

/// The held-out budget: the laws through the other budgets, and the measurement there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    pub budget_flops: f64,
    /// The minimum measured there, by the method that the laws use.
    pub minimum: Minimum,
    /// The exponents of the laws through the minima of the other budgets.
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
    /// Whether N_nv and N_v are separate.
    #[serde(default)]
    pub parameters: Parameters,
    /// n_ctx of the sweep's models, for the `openai` count of a prediction; absent if unknown.
    #[serde(default)]
    pub n_ctx: Option<usize>,
    /// The mean fraction of the vocabulary that a code is chosen among, for the same count: below 1 if each scale has
    /// its own head.
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
    /// The parametric loss, if the laws come from one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parametric: Option<Parametric>,
    pub sensitivity: Vec<Sensitivity>,
    /// Budgets predicted by laws that had not seen them.
    #[serde(default)]
    pub validation: Vec<Validation>,
    /// Advice on further runs.
    #[serde(default)]
    pub advice: Vec<Advice>,
    /// The noise of single runs, used by the bootstrap; absent if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<RunNoise>,
    /// Replicates of the bootstrap: each holds the coefficients of one, for intervals.
    pub bootstrap: Vec<LawSample>,
    /// Warnings: data left out, coefficients that are not identified.
    pub warnings: Vec<String>,
    /// The recommended law, and its reliability.
    #[serde(flatten)]
    pub judgement: Judgement,
    /// The answer shown by screen, figures, report and files; absent in an older file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answer: Option<Answer>,
}

impl Laws {
    /// The law of N_v in N_nv, unless the losses depend on V no more than by chance.
    pub fn told_vocab_from_nonvocab(&self) -> Option<&PowerLaw> {
        self.vocab_from_nonvocab.as_ref().filter(|_| !self.judgement.vocab_is_chance)
    }

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

    /// The one V that all runs have; `None` if several were tried or none is known.
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

    /// The symbol of the loss: L_u in a sweep, L in a table.
    pub fn loss_symbol(&self) -> &'static str {
        if self.from_sweep { "L_u" } else { "L" }
    }
}

/// How laws were come by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LawKind {
    /// Through the minima of IsoFLOP budgets (Hoffmann et al. 2022, approach 2; ScaMo).
    #[default]
    Isoflop,
    /// Through the running minimum of the loss (approach 1).
    Approach1,
    /// Taken from a paper.
    Published,
    /// By a parametric loss: `approach3`, `approach3-vocab`.
    #[serde(untagged)]
    Parametric(Form),
}

impl LawKind {
    /// Every kind that can be fitted.
    pub fn fitted() -> impl Iterator<Item = Self> {
        [Self::Isoflop, Self::Approach1].into_iter().chain(Form::ALL.map(Self::Parametric))
    }

    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Isoflop => "isoflop",
            Self::Approach1 => "approach1",
            Self::Published => "published",
            Self::Parametric(form) => form.name(),
        }
    }

    /// A line for the help.
    pub fn about(self) -> &'static str {
        match self {
            Self::Isoflop => "Minima of each budget, power laws through them, loss laws",
            Self::Approach1 => "Power laws through the running minimum of the loss",
            Self::Published => "Taken from a paper",
            Self::Parametric(form) => form.equation(),
        }
    }

    /// Whether its power laws hold around one budget alone.
    pub fn bends(self) -> bool {
        matches!(self, Self::Parametric(form) if form.parameters() == Parameters::Split)
    }
}

// The answer of a fit, shared by screen, figures, report, notebook and files.

/// The answer of a fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The law that everything below is of: `joint`, `floor`, `approach3`, …
    pub law: String,
    /// The kind of minima of the law; absent if it is fitted to the cells.
    pub method: Option<MinimumMethod>,
    /// Why this law.
    pub why: String,
    /// The loss, with numbers.
    pub formula: String,
    pub coefficients: BTreeMap<String, Coefficient>,
    /// `nats`, or another unit that the name of the loss tells; else `as given`.
    pub loss_unit: String,
    /// The exponents in C of the optimum over the fitted budgets.
    pub exponents: PerQuantity<Exponent>,
    /// The optimum from the smallest to the largest fitted budget, for figures.
    pub path: Vec<OptimumAt>,
    /// The errors of each tested law on budgets left out of its fit.
    pub held_out: Vec<HeldOutError>,
    /// One sentence.
    pub verdict: String,
    pub doubts: Vec<Doubt>,
}

/// A coefficient with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coefficient {
    pub value: f64,
    pub ci95: Option<[f64; 2]>,
}

/// The error of a law, fitted to smaller budgets, on a larger one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOutError {
    pub law: String,
    pub budget_flops: f64,
    /// Budgets that the law was fitted to.
    pub n_fitted: usize,
    /// Predicted less measured loss: of the minimum, or, by a joint law, over the cells round it.
    pub error: f64,
}

impl PerQuantity<Exponent> {
    /// Whether no exponent is determined.
    pub fn is_undetermined(&self) -> bool {
        self.named().all(|(_, exponent)| exponent.value.is_none())
    }
}

/// An exponent, or why there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Exponent {
    pub value: Option<f64>,
    /// 95 %.
    pub ci95: Option<[f64; 2]>,
    /// The budgets between which the exponent holds.
    pub range_flops: [f64; 2],
    /// Why the value is absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// A reason to believe a fit less.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Doubt {
    pub kind: String,
    pub what: String,
    /// The remedy.
    #[serde(rename = "do")]
    pub remedy: String,
}

/// The optimum of one budget.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimumAt {
    pub budget_flops: f64,
    #[serde(flatten)]
    pub at: PerQuantity<Coefficient>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss: Option<Coefficient>,
}

// Advice on further runs.

/// The purpose of further runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AdviceKind {
    /// Sizes past an edge of a budget's grid, or more sizes if there are too few.
    AddSizes,
    /// Vocabularies past an edge of a budget's grid.
    AddVocabularies,
    /// Further seeds, if a curve is flat within its noise.
    AddSeeds,
    /// A further budget, since an exponent's interval is wide.
    LargerBudget,
    /// The centre of a further budget, although nothing requires it.
    NextBudget,
}

/// Advised runs: every size with every vocabulary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    pub kind: AdviceKind,
    pub budget_flops: f64,
    /// N_nv of the runs; N if it is not separate.
    pub params_nonvocab: Vec<f64>,
    /// V of the runs; empty if it is not known.
    pub n_vocab: Vec<f64>,
    /// Sizes × vocabularies × the sweep's runs of a cell.
    pub runs: usize,
    /// Their cost.
    pub flops: f64,
    /// The reason, for a person.
    pub why: String,
}
