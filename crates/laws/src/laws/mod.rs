//! From finished runs to laws: pure functions over a table of points.
//!
//! `IsoFlopPoint → Minimum → PowerLaw, LossLaws`, gathered in [`Laws`].
//!
//! | step | function |
//! | --- | --- |
//! | rows into budgets, checked | [`group_budgets`] |
//! | the best configuration of each budget | [`minima()`], [`minimum_at`] |
//! | N_v, N_nv and D in C; N_v in N_nv | [`power_law`] |
//! | L_u in C | [`log_law()`], [`floor_law()`] |
//! | the laws of the running minimum | [`approach1()`] |
//! | the loss in N and D at once | [`fit_parametric`], [`optimum`] |
//! | all of it, with intervals, errors on unseen budgets and advice | [`fit()`] |
//! | which runs to train next | [`next_runs`] |
//! | the optimum of a few cells that test a forecast | [`cross_optimum`] |
//! | the published law | [`scamo()`] |
//! | the vocabulary laws of Tao et al. 2024, as published | [`tao`] |
//! | the frontier of loss in compute, and its laws | [`frontier()`], [`tao::frontier_laws`] |
//! | N_v in N_nv by the derivative of the compute | [`tao::derivative_gamma`] |
//! | for a person | [`verdict()`], [`summary()`] |
//!
//! # Example
//!
//! ```
//! use isoflop_laws::laws::{FitOptions, IsoFlopPoint, Metric, RunFacts, fit};
//!
//! // Runs whose best size is 0.1 √C: at each budget the loss is a parabola in ln N around it.
//! let mut points = Vec::new();
//! for budget in [1e16, 1e17, 1e18_f64] {
//!     for step in -3..=3 {
//!         let ratio = 2f64.powi(step);
//!         let params = 0.1 * budget.sqrt() * ratio;
//!         points.push(IsoFlopPoint {
//!             run_id: format!("{budget:e} {step}"),
//!             seed: 0,
//!             budget_flops: budget,
//!             flops: budget,
//!             params_nonvocab: params,
//!             params_vocab: 0.5 * params,
//!             n_vocab: 256.0,
//!             tokens: budget / (6.0 * 1.5 * params),
//!             metric: Metric::default(),
//!             loss: -0.1 * budget.log10() + 0.02 * ratio.ln().powi(2),
//!             weight: 1.0,
//!             about: RunFacts::default(),
//!         });
//!     }
//! }
//! let laws = fit(&points, &FitOptions::default())?;
//! let law = laws.power_laws.params_nonvocab.expect("three budgets have minima");
//! assert!((law.exponent - 0.5).abs() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod advice;
mod advice_grid;
mod answer;
mod approach1;
mod bootstrap;
mod brief;
mod budget;
mod cell;
mod check;
mod cholesky;
#[cfg(test)]
mod coverage;
mod cross;
mod design;
mod difference;
mod engine;
mod error;
mod fit;
mod floor_law;
mod forecast_error;
mod intervals;
mod joint;
mod judgement;
mod law_kind;
mod law_set;
mod least_squares;
mod line;
mod log_law;
mod lost_runs;
mod lost_shares;
mod method;
mod metric;
mod minima;
mod miss;
pub mod names;
mod noise;
mod options;
mod parametric;
mod point;
mod power;
mod random;
mod ranking;
mod recommended;
mod report;
mod robust;
mod sample;
mod scamo;
mod select;
mod sensitivity;
#[cfg(test)]
pub mod simulated;
mod slices;
mod split;
mod stats;
mod summary;
mod summary_checks;
pub mod tao;
mod test_noise;
mod test_split;
pub mod text;
mod tokenizer_noise;
mod types;
mod unfitted;
mod validation;
mod verdict;
mod warnings;

pub use answer::{Answer, Coefficient, Doubt, Exponent, HeldOutError, OptimumAt, OwnExponents};
pub use approach1::{Approach1Options, FrontierPoint, approach1, frontier};
pub use brief::brief;
pub use budget::{Budget, group_budgets, of_largest_share};
pub use cross::{cross_optimum, tied_cells};
pub use design::{DesignGoal, OpenRun, next_runs};
pub use difference::{Difference, Estimate};
pub use error::FitError;
pub use fit::fit;
pub use floor_law::floor_law;
pub use forecast_error::ForecastError;
pub use joint::{JointLaw, JointLoss, JointOptimum, JointSized, Repetition, Terms};
pub use judgement::{IntervalPart, Judgement, Tried};
pub use law_kind::LawKind;
pub use least_squares::{LeastSquares, least_squares};
pub use log_law::log_law;
pub use metric::{LOSS_NORMALISED, Metric};
pub use minima::{WIDEST_STEP, minima, minimum_at};
pub use miss::{Miss, MissedMinimum, Off};
pub use options::{FitOptions, HoldOut, Weights};
pub use parametric::around;
pub use parametric::{
    Coefficients, Form, Huber, Influence, Optimum, Parametric, ParametricOptions, Space, Starts,
    fit_parametric, optimum, parametric_laws, parametric_text, vocab_exponent,
};
pub use point::{IsoFlopPoint, Parameters, RunFacts};
pub use power::power_law;
pub use random::Normals;
pub use recommended::{Belief, Candidate, Recommended, Score};
pub use report::*;
pub use sample::*;
pub use scamo::scamo;
pub use sensitivity::sensitivity_row;
pub use slices::{Slices, slices};
pub use stats::interval95;
pub use summary::summary;
pub use test_noise::TestNoise;
pub use text::{fit_to_terminal, times, wrap};
pub use tokenizer_noise::TokenizerNoise;
pub use types::*;

pub use method::MinimumMethod;
pub use verdict::verdict;
