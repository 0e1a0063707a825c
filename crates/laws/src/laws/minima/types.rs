//! What a budget has its minimum at, and how far that is to be trusted.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::laws::input::method::MinimumMethod;

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

/// What a law asks for at a budget; `params_nonvocab` is N, and N_v is 0, if the law knows N alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optimum {
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    /// V, if the law tells it.
    pub n_vocab: Option<f64>,
    pub tokens: f64,
    pub loss: f64,
}

/// A minimum, and how sharply its curve bends there.
pub(super) struct Located {
    pub minimum: Minimum,
    pub curvature: Option<Curvature>,
}

/// The smallest second derivative at a minimum, and what its interval needs.
pub(super) struct Curvature {
    pub value: f64,
    /// Standard error for noise of unit standard deviation.
    pub unit_error: f64,
    pub rss: f64,
    /// Runs that each point of the curve is worth.
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

/// How far runs lie from the curves of a method, against their own scatter.
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

    /// How many times the variance of the runs their squared distance from the curves is, where the
    /// curves misfit; else 1.
    pub fn variance_ratio(&self) -> f64 {
        if self.is_misfit() { (self.chi2 / self.dof as f64).max(1.0) } else { 1.0 }
    }
}

/// Probability of a larger χ² below which curves misfit.
const MISFIT: f64 = 0.01;

impl fmt::Display for MinimumFlag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}
