//! From finished runs to laws: pure functions over a table of points.
//!
//! `IsoFlopPoint → Minimum → PowerLaw, LossLaws`, gathered in [`Laws`].
//!
//! | floor | room | what it is for | beside it |
//! | --- | --- | --- | --- |
//! | 1 | `maths` | statistics, lines, least squares and draws, which know nothing of runs | |
//! | 1 | `words` | numbers for a person | |
//! | 2 | `input` | what a fit is given: runs and how it is asked for; runs by budget and cell: [`group_budgets`] | |
//! | 3 | `minima` | the best configuration of each budget: [`minima()`], [`minimum_at`]; of a few cells that test a forecast: [`cross_optimum`] | |
//! | 4 | `noise` | the scatter of runs, of tokenizers and of test splits | |
//! | 5 | `lines` | laws through minima: [`power_law`], [`log_law()`], [`floor_law()`], with intervals; equal FLOPs by another count: [`slices()`] | |
//! | 5 | `joint` | one smooth loss over all cells, its optimum and its intervals: [`JointLaw`] | |
//! | 5 | `parametric` | the loss in N and D of papers, by variable projection: [`fit_parametric`], [`optimum`] | |
//! | 6 | `ranking` | which law predicts the larger budgets: [`Recommended`] | |
//! | 7 | `file` | what `laws.json` holds: [`Laws`] | |
//! | 8 | `say` | all of this in sentences | |
//! | 9 | `answer` | what laws say, once, for screen, figures, report and files: [`Laws::answered`] | |
//! | 9 | `design` | what to run next: [`next_runs`], [`Advice`] | |
//! | 10 | `fit` | all of it: [`fit()`]; by the running minimum: [`approach1()`]; from a parametric loss: [`parametric_laws`] | |
//! | 10 | `published` | laws of papers: [`scamo()`] | |
//!
//! A room imports from rooms of lower floors; `tests/floors.rs` reads this table.
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

mod answer;
#[cfg(test)]
mod coverage;
mod design;
mod file;
mod fit;
mod input;
mod joint;
mod lines;
mod maths;
mod minima;
mod noise;
mod parametric;
mod published;
mod ranking;
mod say;
#[cfg(test)]
pub mod simulated;
mod words;

pub use design::open_run::OpenRun;
pub use design::{DesignGoal, next_runs};
pub use file::advice::{Advice, AdviceKind};
pub use file::answer::{Answer, Coefficient, Doubt, Exponent, HeldOutError, OptimumAt};
pub use file::difference::{Difference, Estimate};
pub use file::judgement::{IntervalPart, Judgement, Tried};
pub use file::kind::LawKind;
pub use file::laws::{HeldOut, Laws};
pub use file::validated::{Inside, Measured, Predicted, Validated};
pub use fit::approach1::approach1;
pub use fit::approach1::frontier::{FrontierPoint, frontier};
pub use fit::fit;
pub use fit::parametric_laws::{around, fit_parametric, parametric_laws};
pub use fit::sensitivity::sensitivity_row;
pub use input::budget::{Budget, group_budgets, of_largest_share};
pub use input::error::FitError;
pub use input::method::MinimumMethod;
pub use input::metric::{LOSS_NORMALISED, Metric};
pub use input::options::{FitOptions, HoldOut, Weights};
pub use input::point::{IsoFlopPoint, Parameters, RunFacts};
pub use input::quantities::PerQuantity;
pub use joint::above::Off;
pub use joint::law::JointLaw;
pub use joint::loss::{JointLoss, Terms};
pub use joint::repetition::Repetition;
pub use joint::sized::SizedLoss;
pub use lines::floor_law::floor_law;
pub use lines::log_law::log_law;
pub use lines::power::power_law;
pub use lines::sample::{FloorSample, LawSample};
pub use lines::slices::{Slices, slices};
pub use lines::types::{
    Exponents, FloorLaw, LogLaw, LossLaws, PowerLaw, PowerLaws, Sensitivity, Validation,
    ValidationKind,
};
pub use maths::least_squares::{LeastSquares, least_squares};
pub use maths::random::Normals;
pub use maths::stats::{interval95, student_t95};
pub(crate) use minima::akima::spline_at;
pub use minima::cross::{CrossOptimum, TiedCells, TriedCells, cross_optimum, tied_cells};
pub use minima::grid::WIDEST_STEP;
pub use minima::run_noise::{NoiseSource, RunNoise};
pub use minima::types::{LackOfFit, Minimum, MinimumFlag, MinimumIntervals, Optimum};
pub use minima::{minima, minimum_at};
pub use noise::test_noise::TestNoise;
pub use noise::tokenizer_noise::TokenizerNoise;
pub use parametric::form::{Coefficients, Form};
pub use parametric::influence::Influence;
pub use parametric::objective::Space;

pub use parametric::optimum::{optimum, vocab_exponent};
pub use parametric::options::{Huber, ParametricOptions};
pub use parametric::search::Starts;
pub use parametric::types::Parametric;
pub use published::scamo::scamo;
pub use ranking::forecast_error::ForecastError;
pub use ranking::miss::{Deviations, Miss, MissedMinimum};
pub use ranking::recommended::{Belief, Candidate, Recommended, Score};
pub use say::flags::flags_text;
pub use words::text;
pub use words::text::times;
