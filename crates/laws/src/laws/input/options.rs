//! How a fit is made.

use super::error::FitError;
use super::method::MinimumMethod;
use super::point::Parameters;

/// Which budget is kept out of the fit, to measure the laws' error at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum HoldOut {
    /// The largest; none, with a warning, where that would leave fewer than two.
    #[default]
    LargestBudget,
    None,
    /// This declared budget, in FLOPs.
    Budget(f64),
}

/// How much each budget weighs in the power laws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Weights {
    #[default]
    Equal,
    /// By its number of runs.
    Runs,
}

/// The options of [`fit`](crate::laws::fit::fit()).
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// Name of the sweep.
    pub name: String,
    /// The rule that [`IsoFlopPoint::flops`](crate::laws::input::point::IsoFlopPoint::flops) was counted by.
    pub flops_rule: String,
    /// Whether the points tell N_nv and N_v apart.
    pub parameters: Parameters,
    /// The kinds of minimum to report and to compare.
    pub methods: Vec<MinimumMethod>,
    /// The kind the laws are fitted to. By default the parabola, where at least three budgets (or
    /// every fitted budget, if there are only two) have an unflagged one; else the argmin, with a
    /// warning.
    pub law_method: Option<MinimumMethod>,
    pub hold_out: HoldOut,
    /// Bootstrap replicates; 0 for none.
    pub bootstrap: usize,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Fit flagged minima too.
    pub keep_flagged: bool,
    pub weights: Weights,
    /// Huber's δ in units of the residuals' MAD (scaled to σ) for the power laws; least squares
    /// where absent.
    pub huber: Option<f64>,
    /// Derive the law of D from the other two so that the laws spend C to first order around C0,
    /// instead of fitting it.
    pub spend_budget: bool,
    /// Rank the laws by their forecasts, and refit them to all budgets where one is held out.
    pub recommend: bool,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            name: "sweep".into(),
            flops_rule: "openai".into(),
            parameters: Parameters::default(),
            methods: vec![MinimumMethod::Argmin, MinimumMethod::Parabola, MinimumMethod::Cubic],
            law_method: None,
            hold_out: HoldOut::default(),
            bootstrap: 1000,
            seed: 0,
            keep_flagged: false,
            weights: Weights::default(),
            huber: None,
            spend_budget: false,
            recommend: true,
        }
    }
}

impl FitOptions {
    /// Rejects a δ that is not a positive number, and a surface over a vocabulary that is not known.
    pub(in crate::laws) fn check(&self) -> Result<(), FitError> {
        let total = self.parameters == Parameters::Total;
        if total && self.law_method == Some(MinimumMethod::Surface) {
            return Err(FitError::BadOption {
                option: "law_method",
                value: MinimumMethod::Surface.to_string(),
                expected: "another kind, since the table has one number of parameters and the \
                           surface needs N_nv and N_v",
            });
        }
        match self.huber {
            Some(delta) if !(delta.is_finite() && delta > 0.0) => Err(FitError::BadOption {
                option: "huber",
                value: delta.to_string(),
                expected: "a finite number above 0",
            }),
            _ => Ok(()),
        }
    }
}
