//! A private directory with the real binary in it, and what tests look at afterwards.

mod finished;
pub mod mounts;
mod place;
pub mod processes;
pub mod records;
mod trainer;

pub use finished::{finished_mini, lawful};
pub use place::{Ended, OWN, Place};
pub use trainer::worked_trainer;
