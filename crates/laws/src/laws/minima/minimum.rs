//! The minimum of a budget, its flags, and the choice of minima for laws.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::laws::input::budget::Budget;
use crate::laws::input::{FitError, FitOptions, HoldOut, MinimumMethod, is_same_budget};
use crate::laws::maths::stats::distinct;

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
    /// A size next to the minimum is best with the smallest or the largest vocabulary tried, so its optimum is
    /// unknown.
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

impl fmt::Display for MinimumFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The flags of all that is so.
pub(super) fn raised<const N: usize>(flags: [(bool, MinimumFlag); N]) -> Vec<MinimumFlag> {
    flags.into_iter().filter_map(|(is, flag)| is.then_some(flag)).collect()
}

/// The best configuration found at one budget.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Minimum {
    pub method: MinimumMethod,
    pub budget_flops: f64,
    /// FLOPs at the minimum by the rule of the fit, interpolated from the runs; differs from `budget_flops` if the
    /// sweep was planned by another rule.
    pub flops: f64,
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    pub n_vocab: f64,
    pub tokens: f64,
    pub loss_normalised: f64,
    /// 95 % intervals; absent if run noise is unknown, or if the best run replaces a minimum that is not inside the
    /// grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ci95: Option<MinimumIntervals>,
    pub flags: Vec<MinimumFlag>,
    /// Whether there is no flag.
    #[serde(default)]
    pub trusted: bool,
}

/// The optimum of a law at a budget; `params_nonvocab` is N, and N_v is 0, if the law has only N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optimum {
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    /// V, if the law has it.
    pub n_vocab: Option<f64>,
    pub tokens: f64,
    pub loss: f64,
}

/// A minimum, and how sharply its curve bends there.
pub(super) struct Located {
    pub minimum: Minimum,
    pub curvature: Option<Curvature>,
}

/// The smallest second derivative at a minimum, with the input of its interval.
pub(super) struct Curvature {
    pub value: f64,
    /// Standard error for noise of unit standard deviation.
    pub unit_error: f64,
    pub rss: f64,
    /// Effective number of runs per point of the curve.
    pub runs: f64,
    pub dof: usize,
}

impl Minimum {
    /// Raises further flags.
    pub(super) fn flag(&mut self, flags: impl IntoIterator<Item = MinimumFlag>) {
        self.flags.extend(flags);
        self.flags.sort();
        self.flags.dedup();
        self.trusted = self.flags.is_empty();
    }

    /// Whether laws may be fitted to it, flagged or not: false only for flags that mean there is no minimum.
    pub fn is_usable(&self) -> bool {
        use MinimumFlag::{DepthChange, EdgeVocab, Gap, LackOfFit};
        self.flags.iter().all(|flag| matches!(flag, EdgeVocab | LackOfFit | Gap | DepthChange))
    }

    /// Whether the values are those of the best run because there is no minimum inside the grid.
    pub fn is_best_run_instead(&self) -> bool {
        use MinimumFlag::{FewLevels, NotBracketed, NotConvex};
        self.flags.iter().any(|flag| matches!(flag, FewLevels | NotBracketed | NotConvex))
    }
}

/// 95 % percentile intervals of a minimum over the bootstrap.
///
/// For [`MinimumMethod::Argmin`] they step from run to run, and have no width if the same run is best in every
/// replicate: they ignore the space between runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MinimumIntervals {
    pub params_nonvocab: Option<[f64; 2]>,
    /// Absent if N_v is not separate.
    pub params_vocab: Option<[f64; 2]>,
    pub loss_normalised: Option<[f64; 2]>,
}

/// Probability of a larger χ² below which curves misfit.
const MISFIT: f64 = 0.01;

/// The distance of runs from the curves of a method, relative to their noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LackOfFit {
    pub method: MinimumMethod,
    /// Squared residuals in units of the scatter, over all curves.
    pub chi2: f64,
    pub dof: usize,
    /// The probability of more, were the curves right.
    pub p: f64,
}

impl LackOfFit {
    /// Whether the runs lie further from the curves than they scatter.
    pub fn is_misfit(&self) -> bool {
        self.p < MISFIT
    }

    /// The ratio of the squared distance from the curves to the variance of runs, if the curves misfit; else 1.
    pub fn variance_ratio(&self) -> f64 {
        if self.is_misfit() { (self.chi2 / self.dof as f64).max(1.0) } else { 1.0 }
    }
}

// The scatter of single runs.

/// The source of the estimate of run noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseSource {
    /// Runs of one cell around their mean.
    Seeds,
    /// Runs of one cell with several tokenizers, minus the effect of each tokenizer; over the better half of each
    /// budget's cells.
    Tokenizers,
    /// Cells around a polynomial of this degree over each budget's grid.
    Surface { degree: usize },
}

/// The scatter of single runs, pooled over the fitted budgets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunNoise {
    /// Standard deviation of one run's loss.
    pub sd: f64,
    /// Degrees of freedom of its square.
    pub dof: usize,
    pub source: NoiseSource,
}

impl RunNoise {
    /// The standard deviation of a run that is guessed where it is not known, in what is worth a nat.
    pub(in crate::laws) const GUESS: f64 = 0.02;
}

// The choice of minima for laws.

/// Minima that laws go through, at least.
const ENOUGH: usize = 3;
/// The kinds of minimum, the first to be preferred.
pub(in crate::laws) const PREFERRED: [MinimumMethod; 5] = [
    MinimumMethod::Parabola,
    MinimumMethod::Akima,
    MinimumMethod::Surface,
    MinimumMethod::Cubic,
    MinimumMethod::Argmin,
];

/// The index of the held-out budget, if any; by default none if there are two.
///
/// # Errors
/// [`FitError::TooFewBudgets`] and [`FitError::HoldOutAbsent`].
pub(in crate::laws) fn hold_out(
    budgets: &[Budget],
    wanted: HoldOut,
) -> Result<Option<usize>, FitError> {
    if budgets.len() < 2 {
        return Err(FitError::TooFewBudgets { found: budgets.len() });
    }
    match wanted {
        HoldOut::None => Ok(None),
        HoldOut::LargestBudget => Ok((budgets.len() > 2).then_some(budgets.len() - 1)),
        HoldOut::Budget(asked) => {
            let same = |b: &Budget| is_same_budget(b.budget_flops, asked);
            let absent = || {
                let budgets = budgets.iter().map(|b| b.budget_flops).collect();
                FitError::HoldOutAbsent { asked, budgets }
            };
            let index = budgets.iter().position(same).ok_or_else(absent)?;
            if budgets.len() == 2 {
                return Err(FitError::TooFewBudgets { found: 1 });
            }
            Ok(Some(index))
        }
    }
}

/// The minima of all budgets by each method.
pub(in crate::laws) type ByMethod = [(MinimumMethod, Vec<Minimum>)];

/// The method the laws are fitted to, unless one is asked for: the first kind of which three minima have no
/// flag, else the first of which three may be used. The best run alone, which is as coarse as the grid, is
/// the last of them.
pub(in crate::laws) fn law_method(per_method: &ByMethod, options: &FitOptions) -> MinimumMethod {
    if let Some(method) = options.law_method {
        return method;
    }
    let minima = |method| per_method.iter().find(|(m, _)| *m == method).map(|(_, minima)| minima);
    let count = |method, is: fn(&Minimum) -> bool| {
        minima(method).map_or(0, |minima| minima.iter().filter(|m| is(m)).count())
    };
    // Best runs are cells of the grid, and no curve is so doubtful that they would be nearer.
    let [curves @ .., best_run] = PREFERRED;
    let is_curve =
        |is: fn(&Minimum) -> bool| curves.into_iter().find(|method| count(*method, is) >= ENOUGH);
    let of_runs = || Some(best_run).filter(|method| count(*method, Minimum::is_usable) >= ENOUGH);
    let method = is_curve(|m| m.trusted).or_else(|| is_curve(Minimum::is_usable));
    method.or_else(of_runs).unwrap_or(PREFERRED[0])
}

/// The minima that a fit may use: unflagged ones, or, if these are fewer than three, flagged ones too; all if flagged
/// ones are kept.
pub(in crate::laws) fn usable(minima: &[Minimum], options: &FitOptions) -> Vec<Minimum> {
    let trusted = minima.iter().filter(|m| m.trusted).count();
    let use_it =
        |m: &&Minimum| options.keep_flagged || m.trusted || (trusted < ENOUGH && m.is_usable());
    minima.iter().filter(use_it).cloned().collect()
}

/// Whether minima determine an exponent: at least three that differ, since a line fits any two, and two best runs of
/// one cell have slope 0 because of the grid.
pub(in crate::laws) fn tell_laws(used: &[Minimum]) -> bool {
    let differ = |of: fn(&Minimum) -> f64| distinct(used.iter().map(of)).len();
    let of_runs = |m: &Minimum| m.method == MinimumMethod::Argmin || m.is_best_run_instead();
    let sizes = !used.iter().any(of_runs) || differ(|m| m.params_nonvocab) >= ENOUGH;
    used.len() >= ENOUGH && sizes && differ(|m| m.loss_normalised) > 1
}
