//! Laws through minima: power laws, the loss in C, and their intervals.

mod law;
mod resampling;

pub(super) use law::EXPONENT_RANGE;
pub use law::{FloorLaw, FloorSample, LogLaw, LossLaws, PowerLaw, floor_law, log_law, power_law};
pub(super) use resampling::{Bootstrap, Replicate, Sources, minima_with_intervals, validate};
pub use resampling::{Validation, ValidationKind};

use self::law::from_line;
use crate::laws::input::{FitOptions, Parameters, PerQuantity, Weights, is_same_budget};
use crate::laws::maths::engine::{Line, least_squares_line};
use crate::laws::maths::stats::{geometric_mean, interval95};
use crate::laws::minima::{Grid, Minimum};
use serde::{Deserialize, Serialize};

/// The power laws of the optimum in C (ScaMo Eq. 9); absent if not identifiable.
pub type PowerLaws = PerQuantity<PowerLaw>;

/// Exponents in C of the size, N_v and D.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Exponents {
    /// The size: N_nv, or N.
    pub size: Option<f64>,
    pub params_vocab: Option<f64>,
    pub tokens: Option<f64>,
}

/// Exponents under another convention or another kind of minimum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sensitivity {
    /// The choice that was changed: "minima: cubic", "flops: 6nd".
    pub variant: String,
    pub exponent_vocab: Option<f64>,
    pub exponent_nonvocab: Option<f64>,
    /// The exponent of N, if the size is one number; then the two above are absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exponent_params: Option<f64>,
    pub exponent_tokens: Option<f64>,
    pub slope_per_decade: Option<f64>,
}

/// One bootstrap replicate: ln y at C0 and the exponent of each law, and the log loss law.
///
/// With one vocabulary, the two vocabulary numbers depend only on the model's width. If only N is known, the
/// non-vocabulary numbers are those of N, and the vocabulary numbers are 0 without meaning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LawSample {
    pub ln_vocab_at_reference: f64,
    pub exponent_vocab: f64,
    pub ln_nonvocab_at_reference: f64,
    pub exponent_nonvocab: f64,
    pub ln_tokens_at_reference: f64,
    pub exponent_tokens: f64,
    pub loss_intercept: f64,
    pub loss_slope_per_decade: f64,
    /// Absent if the replicate had no floor law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<FloorSample>,
}

/// ln y at C0 and the exponent of each law.
impl LawSample {
    pub fn size(&self) -> (f64, f64) {
        (self.ln_nonvocab_at_reference, self.exponent_nonvocab)
    }

    pub fn vocab(&self) -> (f64, f64) {
        (self.ln_vocab_at_reference, self.exponent_vocab)
    }

    pub fn tokens(&self) -> (f64, f64) {
        (self.ln_tokens_at_reference, self.exponent_tokens)
    }
}

/// The laws through a set of minima, around C0.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LawSet {
    /// C0.
    pub reference: f64,
    /// `None` if N_v is not separate.
    pub params_vocab: Option<PowerLaw>,
    /// The law of N, if N_v is not separate.
    pub params_nonvocab: PowerLaw,
    pub tokens: PowerLaw,
    /// N_v in N_nv (ScaMo Eq. 10); `None` if N_nv does not vary or N_v is not separate.
    pub vocab_from_nonvocab: Option<PowerLaw>,
    pub log: LogLaw,
    /// None for fewer than three C, or if the loss does not fall with C.
    pub floor: Option<FloorLaw>,
}

/// One replicate's coefficients, and the exponent of Eq. 10 where N_nv varied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReplicateLaws {
    pub sample: LawSample,
    pub vocab_from_nonvocab: Option<f64>,
}

impl LawSet {
    /// The laws through some minima, around the middle of their budgets.
    pub fn through(minima: &[Minimum], grids: &[Grid], options: &FitOptions) -> Option<Self> {
        let columns = Columns::new(minima, grids, options);
        law_set(&columns, geometric_mean(&columns.compute), options)
    }

    /// The power laws by quantity; N_v only if `several` vocabularies were tried.
    pub fn powers(&self, several: bool, parameters: Parameters) -> PowerLaws {
        let all = PowerLaws {
            params_nonvocab: Some(self.params_nonvocab.clone()),
            params_vocab: self.params_vocab.clone().filter(|_| several),
            tokens: Some(self.tokens.clone()),
            ..PowerLaws::default()
        };
        all.under(parameters)
    }

    /// The coefficients of one bootstrap replicate; `None` if one is not finite.
    pub fn sample(&self) -> Option<LawSample> {
        let vocab = self.params_vocab.as_ref();
        let sample = LawSample {
            ln_vocab_at_reference: vocab.map_or(0.0, |law| law.ln_at_reference),
            exponent_vocab: vocab.map_or(0.0, |law| law.exponent),
            ln_nonvocab_at_reference: self.params_nonvocab.ln_at_reference,
            exponent_nonvocab: self.params_nonvocab.exponent,
            ln_tokens_at_reference: self.tokens.ln_at_reference,
            exponent_tokens: self.tokens.exponent,
            loss_intercept: self.log.intercept,
            loss_slope_per_decade: self.log.slope_per_decade,
            floor: self.floor.as_ref().map(FloorLaw::sample),
        };
        let laws = [vocab, Some(&self.params_nonvocab), Some(&self.tokens)];
        let finite =
            laws.iter().flatten().all(|law| (law.ln_at_reference + law.exponent).is_finite());
        (finite && (self.log.intercept + self.log.slope_per_decade).is_finite()).then_some(sample)
    }

    /// The laws with the interval of every coefficient.
    pub fn with_intervals(mut self, replicates: &[ReplicateLaws]) -> Self {
        let samples: Vec<LawSample> = replicates.iter().map(|r| r.sample).collect();
        let ln_reference = self.reference.ln();
        let power = |law: &mut PowerLaw, of: fn(&LawSample) -> (f64, f64)| {
            law.set_intervals(&samples.iter().map(of).collect::<Vec<_>>(), ln_reference);
        };
        if let Some(law) = &mut self.params_vocab {
            power(law, LawSample::vocab);
        }
        power(&mut self.params_nonvocab, LawSample::size);
        power(&mut self.tokens, LawSample::tokens);
        if let Some(law) = &mut self.vocab_from_nonvocab {
            law.exponent_ci95 = interval95(replicates.iter().filter_map(|r| r.vocab_from_nonvocab));
        }
        self.log.slope_ci95 = interval95(samples.iter().map(|s| s.loss_slope_per_decade));
        self.log.intercept_ci95 = interval95(samples.iter().map(|s| s.loss_intercept));
        let floors: Vec<FloorSample> = samples.iter().filter_map(|sample| sample.floor).collect();
        self.floor = self.floor.map(|law| law.with_intervals(&floors));
        self
    }
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

/// The minima as columns, C in the axis asked for.
pub(super) struct Columns {
    pub compute: Vec<f64>,
    pub params_vocab: Vec<f64>,
    pub params_nonvocab: Vec<f64>,
    pub tokens: Vec<f64>,
    pub loss: Vec<f64>,
    pub weights: Vec<f64>,
}

impl Columns {
    /// `grids` holds the grid of every minimum, in any order and among others.
    pub fn new(minima: &[Minimum], grids: &[Grid], options: &FitOptions) -> Self {
        let column = |value: &dyn Fn(&Minimum) -> f64| minima.iter().map(value).collect();
        let grid_of = |m: &Minimum| {
            grids.iter().find(|grid| is_same_budget(grid.budget_flops, m.budget_flops))
        };
        let weight = |m: &Minimum| match options.weights {
            Weights::Equal => 1.0,
            Weights::Runs => grid_of(m).map_or(1.0, |grid| grid.n_runs as f64),
        };
        Self {
            compute: column(&|m| m.budget_flops),
            params_vocab: column(&|m| m.params_vocab),
            params_nonvocab: column(&|m| m.params_nonvocab),
            tokens: column(&|m| m.tokens),
            loss: column(&|m| m.loss_normalised),
            weights: column(&weight),
        }
    }
}

/// The laws through `columns` around C0 = `reference`; none if C does not vary.
pub(super) fn law_set(columns: &Columns, reference: f64, options: &FitOptions) -> Option<LawSet> {
    let in_compute = |y| power_law(&columns.compute, y, reference, &columns.weights, options.huber);
    let params_vocab = match options.parameters {
        Parameters::Split => Some(in_compute(&columns.params_vocab)?),
        Parameters::Total => None,
    };
    let params_nonvocab = in_compute(&columns.params_nonvocab)?;
    let tokens = match options.spend_budget {
        false => in_compute(&columns.tokens)?,
        true => spending_tokens(columns, reference, &params_nonvocab, params_vocab.as_ref())?,
    };
    let (x, y) = (&columns.params_nonvocab, &columns.params_vocab);
    let in_nonvocab = || power_law(x, y, geometric_mean(x), &columns.weights, options.huber);
    let vocab_from_nonvocab = params_vocab.as_ref().and_then(|_| in_nonvocab());
    let log = log_law(&columns.compute, &columns.loss)?;
    let floor = floor_law(&columns.compute, &columns.loss, reference);
    Some(LawSet {
        reference,
        params_vocab,
        params_nonvocab,
        tokens,
        vocab_from_nonvocab,
        log,
        floor,
    })
}

/// The law of D that makes the three laws spend C, to first order around C0.
///
/// C = κ(N_nv + N_v)D holds at every minimum, with κ = 6 under the rule `6nd` and a slowly varying
/// κ ∝ C^e, read off the minima, under the others. Three power laws cannot meet it at every C; they
/// meet it and its first derivative at C0 with ln D(C0) = ln C0 − ln κ − ln(N_nv + N_v) and
/// c = 1 − e − (w a + (1 − w) b), where a, b and c are the exponents of N_nv, N_v and D, and
/// w = N_nv/(N_nv + N_v) at C0.
fn spending_tokens(
    columns: &Columns,
    reference: f64,
    nonvocab: &PowerLaw,
    vocab: Option<&PowerLaw>,
) -> Option<PowerLaw> {
    let ln_c: Vec<f64> = columns.compute.iter().map(|c| c.ln()).collect();
    let ln_tokens: Vec<f64> = columns.tokens.iter().map(|d| d.ln()).collect();
    let totals = columns.params_nonvocab.iter().zip(&columns.params_vocab).map(|(n, v)| n + v);
    let ln_kappa: Vec<f64> =
        totals.zip(&ln_c).zip(&ln_tokens).map(|((n, c), d)| c - n.ln() - d).collect();
    let kappa = least_squares_line(&ln_c, &ln_kappa, &columns.weights)?;
    let n = nonvocab.ln_at_reference.exp();
    let (v, vocab_exponent) =
        vocab.map_or((0.0, 0.0), |law| (law.ln_at_reference.exp(), law.exponent));
    let share = n / (n + v);
    let growth = share * nonvocab.exponent + (1.0 - share) * vocab_exponent;
    let centre = reference.ln();
    let level = centre - kappa.at(centre) - (n + v).ln();
    let line = Line { centre, level, slope: 1.0 - kappa.slope - growth };
    Some(from_line(&line, &ln_c, &ln_tokens, reference, &columns.weights))
}
