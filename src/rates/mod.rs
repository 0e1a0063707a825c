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
