//! From finished runs to laws: pure functions over a table of points.
//!
//! `IsoFlopPoint → Minimum → PowerLaw, LossLaws`, gathered in [`Laws`].
//!
//! | floor | module | content | also imports |
//! | --- | --- | --- | --- |
//! | 1 | `maths` | statistics, lines, least squares and draws, which know nothing of runs; numbers for a person: [`text`] | |
//! | 2 | `input` | what a fit is given: runs and how it is asked for; runs by budget and cell: [`group_budgets`] | |
//! | 3 | `slices` | equal FLOPs by another count: [`slices()`] | |
//! | 3 | `minima` | the best configuration of each budget: [`minima()`], [`minimum_at`]; of a few cells that test a forecast: [`cross_optimum`] | |
//! | 4 | `noise` | the scatter of runs, of tokenizers and of test splits | |
//! | 5 | `lines` | laws through minima: [`power_law`], [`log_law()`], [`floor_law()`], with intervals | |
//! | 5 | `joint` | one smooth loss over all cells, its optimum and its intervals: [`JointLaw`] | |
//! | 5 | `parametric` | the loss in N and D of papers, by variable projection: [`fit_parametric`], [`optimum`] | |
//! | 6 | `ranking` | the law that predicts larger budgets best: [`Recommended`] | |
//! | 7 | `file` | the contents of `laws.json`: [`Laws`] | |
//! | 8 | `say` | all of this in sentences | |
//! | 9 | `answer` | what laws say, once, for screen, figures, report and files: [`Laws::answered`] | |
//! | 9 | `advice` | what a sweep leaves open: [`Advice`] | |
//! | 9 | `design` | which runs of a round to train next: [`next_runs`] | |
//! | 10 | `fit` | all of it: [`fit()`]; by the running minimum: [`approach1()`]; from a parametric loss: [`parametric_laws`] | |
//! | 10 | `published` | laws of papers: [`scamo()`] | |
//!
//! A module imports modules of lower floors; `tests/floors.rs` reads this table.
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
mod answer;
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
mod slices;

pub use design::{DesignGoal, OpenRun, next_runs};
pub use file::{
    Advice, AdviceKind, Answer, Coefficient, Doubt, Exponent, HeldOut, HeldOutError, Inside,
    IntervalPart, Judgement, LawKind, Laws, Measured, OptimumAt, Predicted, Tried, Validated,
};
pub use fit::{
    FrontierPoint, approach1, around, fit, fit_parametric, frontier, parametric_laws,
    sensitivity_row,
};
pub use input::budget::Budget;
pub use input::{
    FitError, FitOptions, HoldOut, IsoFlopPoint, LOSS_NORMALISED, Metric, MinimumMethod,
    Parameters, PerQuantity, RunFacts, Weights, group_budgets, of_largest_share,
};
pub use joint::{JointLaw, JointLoss, Off, Repetition, SizedLoss, Terms};
pub use lines::{
    Exponents, FloorLaw, FloorSample, LawSample, LogLaw, LossLaws, PowerLaw, PowerLaws,
    Sensitivity, Validation, ValidationKind, floor_law, log_law, power_law,
};
pub use maths::stats::{Difference, Estimate, Normals, interval95, student_t95};
pub use maths::text::{self, times};
pub use maths::{LeastSquares, least_squares};
pub use minima::{
    CrossOptimum, LackOfFit, Minimum, MinimumFlag, MinimumIntervals, NoiseSource, Optimum,
    RunNoise, TiedCells, TriedCells, WIDEST_STEP, cross_optimum, minima, minimum_at, tied_cells,
};
pub use noise::{TestNoise, TokenizerNoise};
pub use parametric::{
    Coefficients, Form, Huber, Influence, Parametric, ParametricOptions, Space, Starts, optimum,
    vocab_exponent,
};
pub use published::scamo;
pub use ranking::{
    Belief, Candidate, Deviations, ForecastError, Miss, MissedMinimum, Recommended, Score,
};
pub use say::flags_text;
pub use slices::{Slices, slices};
