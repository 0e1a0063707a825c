//! The rule of learning rate and batch, found by trials at a few cells of a grid.
//!
//! `cells → trials → the next trials → … → a rule`: each step is a function of the trials that have
//! ended, so a search that was cut off goes on from its records.
//!
//! | step | file |
//! | --- | --- |
//! | which cells of a grid are tried | `choose` |
//! | a setting of rate, batch and schedule, and what came of it | `trial` |
//! | what is tried next | `search` |
//! | trials into a rule | `rule`, on `optimum` |
//!
//! # Example
//!
//! ```
//! use isoflop::rates::{Place, choose};
//!
//! // Which of a grid's cells tell most of how the best rate goes with N, V and D.
//! let cells: Vec<Place> = [1e3, 2e3, 4e3, 8e3, 1.6e4]
//!     .into_iter()
//!     .flat_map(|params_nonvocab| [1e9, 4e9, 1.6e10].map(|budget_flops| (params_nonvocab, budget_flops)))
//!     .map(|(params_nonvocab, budget_flops)| Place {
//!         budget_flops,
//!         params_nonvocab,
//!         n_vocab: 256.0,
//!         tokens: budget_flops / (6.0 * params_nonvocab),
//!         lr: 1e-3,
//!     })
//!     .collect();
//! assert!(choose(&cells, 4).len() <= 4);
//! ```

mod choose;
mod optimum;
mod rule;
mod search;
#[cfg(test)]
mod tests;
mod trial;

pub use choose::choose;
pub use optimum::CellRate;
pub use rule::{Rule, fit_rule};
pub use search::next;
pub use trial::{Place, Setting, Trial};
