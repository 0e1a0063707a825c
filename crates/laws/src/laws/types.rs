//! The values between a table of runs and a law; [`Laws`] is what `laws.json` holds.

use super::law_set::LawSet;
use super::{
    Advice, Answer, Candidate, Judgement, LawKind, LawSample, Metric, Parameters, Parametric,
    RunNoise, Validation,
};
use serde::{Deserialize, Serialize};

use crate::laws::MinimumMethod;

/// Why a minimum should not be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MinimumFlag {
    /// The minimum lies at or outside the smallest or largest model tried.
    NotBracketed,
    /// The fitted curve opens downwards.
    NotConvex,
    /// The interval of the curvature holds zero.
    WeakCurvature,
    /// Fewer levels than the curve needs: three sizes, four for the cubic, five for Akima's
    /// spline; for the surface six cells over three sizes and three vocabularies.
    FewLevels,
    /// The best vocabulary is the smallest or the largest tried.
    VocabNotBracketed,
    /// A size beside the minimum is best with the smallest or the largest vocabulary tried, so that
    /// its own optimum is not known.
    EdgeVocab,
    /// The runs lie further from the curve than their scatter allows.
    LackOfFit,
    /// The curve lies further below the best run than noise and the sizes' distance allow.
    BelowRuns,
    /// The sizes on either side are more than a factor of 2.5 apart.
    Gap,
    /// The models on either side differ in depth.
    DepthChange,
}

impl MinimumFlag {
    /// Whether there is no minimum to fit, rather than one in doubt.
    pub fn excludes(self) -> bool {
        !matches!(self, Self::EdgeVocab | Self::LackOfFit | Self::Gap | Self::DepthChange)
    }
}

/// The best configuration found at one budget.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Minimum {
    pub method: MinimumMethod,
    pub budget_flops: f64,
    /// What a run at the minimum spends under the rule that the fit uses, as interpolated from the
    /// runs; it leaves `budget_flops` behind where the sweep was planned under another rule.
    pub flops: f64,
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    pub n_vocab: f64,
    pub tokens: f64,
    pub loss_normalised: f64,
    /// 95 % intervals; absent where the noise of the runs is not known, and where the best run stands
    /// in for a minimum that is not inside the grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ci95: Option<MinimumIntervals>,
    pub flags: Vec<MinimumFlag>,
    /// Whether there is no flag.
    #[serde(default)]
    pub trusted: bool,
}

impl Minimum {
    /// Raises further flags.
    pub(super) fn flag(&mut self, flags: impl IntoIterator<Item = MinimumFlag>) {
        self.flags.extend(flags);
        self.flags.sort();
        self.flags.dedup();
        self.trusted = self.flags.is_empty();
    }

    /// Whether laws may be fitted to it, be it in doubt or not.
    pub fn is_usable(&self) -> bool {
        !self.flags.iter().any(|flag| flag.excludes())
    }

    /// Whether the values are those of the best run because there is no minimum inside the grid.
    pub fn is_best_run_instead(&self) -> bool {
        use MinimumFlag::{FewLevels, NotBracketed, NotConvex};
        self.flags.iter().any(|flag| matches!(flag, FewLevels | NotBracketed | NotConvex))
    }
}

/// 95 % percentile intervals of a minimum over the bootstrap.
///
/// Those of the kind [`MinimumMethod::Argmin`] step from run to run, and have no width where the
/// same run is the best in every replicate: they do not know what lies between the runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MinimumIntervals {
    pub params_nonvocab: Option<[f64; 2]>,
    /// Absent where N_v is not told apart.
    pub params_vocab: Option<[f64; 2]>,
    pub loss_normalised: Option<[f64; 2]>,
}

/// log10 y = `log10_coefficient` + `exponent` · log10 x.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PowerLaw {
    pub log10_coefficient: f64,
    pub exponent: f64,
    /// ln y at the reference budget of [`Laws::reference_flops`]; the well-determined intercept.
    /// For N_v in N_nv it is ln N_v at the geometric mean of the fitted N_nv.
    pub ln_at_reference: f64,
    /// 1 − RSS/TSS in ln y; 0 where y does not vary, and where a published law gives none (`n` 0).
    pub r2: f64,
    /// 95 % bootstrap percentile interval; absent where too few points allow none.
    pub exponent_ci95: Option<[f64; 2]>,
    #[serde(default)]
    pub ln_at_reference_ci95: Option<[f64; 2]>,
    #[serde(default)]
    pub log10_coefficient_ci95: Option<[f64; 2]>,
    /// Points fitted; 0 for a published law.
    pub n: usize,
}

impl PowerLaw {
    /// R², where it says something: a line goes through any two points.
    pub fn told_r2(&self) -> Option<f64> {
        (self.n > 2).then_some(self.r2)
    }
}

/// L_u = `slope_per_decade` · log10 C + `intercept` (ScaMo Eq. 14).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogLaw {
    pub slope_per_decade: f64,
    pub intercept: f64,
    pub r2: f64,
    pub aic: f64,
    /// Predicted minus measured at the held-out budget, in nats.
    pub held_out_error: Option<f64>,
    pub slope_ci95: Option<[f64; 2]>,
    #[serde(default)]
    pub intercept_ci95: Option<[f64; 2]>,
    pub n: usize,
}

impl LogLaw {
    /// R² and AIC, where they say something: a line goes through any two points.
    pub fn goodness(&self) -> Option<[f64; 2]> {
        (self.n > 2).then_some([self.r2, self.aic])
    }
}

/// L_u = `floor` + `coefficient` · (C / C0)^(−`exponent`), C0 = [`Laws::reference_flops`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FloorLaw {
    pub floor: f64,
    pub coefficient: f64,
    pub exponent: f64,
    pub r2: f64,
    pub aic: f64,
    /// Predicted minus measured at the held-out budget, in nats.
    pub held_out_error: Option<f64>,
    #[serde(default)]
    pub floor_ci95: Option<[f64; 2]>,
    #[serde(default)]
    pub coefficient_ci95: Option<[f64; 2]>,
    #[serde(default)]
    pub exponent_ci95: Option<[f64; 2]>,
    pub n: usize,
}

impl FloorLaw {
    /// R² and AIC, where they say something: some such law goes through almost any three points.
    pub fn goodness(&self) -> Option<[f64; 2]> {
        (self.n > 3).then_some([self.r2, self.aic])
    }
}

/// The two loss laws, always side by side.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LossLaws {
    pub log: Option<LogLaw>,
    pub floor: Option<FloorLaw>,
}

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

/// Exponents in C of the size, N_v and D.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Exponents {
    /// Of N_nv, or N.
    pub size: Option<f64>,
    pub params_vocab: Option<f64>,
    pub tokens: Option<f64>,
}

impl Exponents {
    pub(super) fn of(set: &LawSet) -> Self {
        Self {
            size: Some(set.params_nonvocab.exponent),
            params_vocab: set.params_vocab.as_ref().map(|law| law.exponent),
            tokens: Some(set.tokens.exponent),
        }
    }
}

/// The three power laws of the optimum in C (ScaMo Eq. 9); absent where not identifiable.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PowerLaws {
    /// N in C, where the parameters are not told apart; then the next two are absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub params: Option<PowerLaw>,
    pub params_vocab: Option<PowerLaw>,
    pub params_nonvocab: Option<PowerLaw>,
    pub tokens: Option<PowerLaw>,
}

/// Exponents under another convention or another kind of minimum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sensitivity {
    /// What was changed, for a person: "minima: cubic", "flops: 6nd".
    pub variant: String,
    pub exponent_vocab: Option<f64>,
    pub exponent_nonvocab: Option<f64>,
    /// Of N, where the size is one number; then the two above are absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exponent_params: Option<f64>,
    pub exponent_tokens: Option<f64>,
    pub slope_per_decade: Option<f64>,
}

/// Every fit of a sweep, with the convention used: `laws.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// What they say; of an older file, which has no answer, made here.
    pub fn answer(&self) -> Answer {
        self.answer.clone().unwrap_or_else(|| self.own_answer())
    }

    /// The smallest and the largest budget that they rest on; C0 for a published law.
    pub fn range(&self) -> [f64; 2] {
        let tried = self.judgement.tried.map(|tried| tried.budgets).filter(|[low, _]| *low > 0.0);
        let used = || Some([*self.fitted_budgets.first()?, *self.fitted_budgets.last()?]);
        tried.or_else(used).unwrap_or([self.reference_flops; 2])
    }

    /// The same for another amount of data: what the joint law with repetition says where `unique_tokens` are
    /// distinct, whichever law is the one to believe, since the others know no data but their own. None
    /// without such a law.
    pub fn on_data(&self, unique_tokens: f64) -> Option<Self> {
        let mut laws = self.clone();
        let joint = laws.judgement.joint.as_ref().filter(|law| law.tells_repetition())?;
        laws.judgement.joint = Some(joint.on_data(unique_tokens));
        laws.judgement.tried.as_mut()?.unique_tokens = Some(unique_tokens);
        let recommended = laws.judgement.recommended.as_mut()?;
        recommended.law = Candidate::JointRepeats;
        recommended.scores.retain(|score| score.law == Candidate::JointRepeats);
        Some(laws.answered())
    }

    /// The law to believe; the log law where none was ranked.
    pub fn recommended_law(&self) -> Candidate {
        self.judgement.recommended.as_ref().map_or(Candidate::Log, |recommended| recommended.law)
    }

    /// What the loss is called: L_u in a sweep, L in a table whose loss may be any.
    pub(super) fn loss_symbol(&self) -> &'static str {
        if self.from_sweep { "L_u" } else { "L" }
    }
}
