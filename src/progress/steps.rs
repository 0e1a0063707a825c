//! What work tells of itself while it goes on: how a scheduler tells slow work from work that hangs.
//!
//! Training tells of its steps ([`Progress`]). What has no steps (reading, tokenising, embedding, measuring) counts
//! each piece that it is done with, so that [their number](pieces) stands still when the work does.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

/// A training step just done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Counted from 1.
    pub step: usize,
    /// Of how many.
    pub steps: usize,
    /// Before the update.
    pub loss: f64,
    /// What the step took, without measuring the model and writing it down.
    pub seconds: f64,
}

/// Is told of each step; may ask for a stop.
pub type Progress<'a> = dyn FnMut(Step) -> ControlFlow<()> + 'a;

static MOVED: AtomicU64 = AtomicU64::new(0);

/// A piece of work is done: a clip read, a batch measured.
pub fn moved() {
    MOVED.fetch_add(1, Ordering::Relaxed);
}

/// Pieces done so far.
pub fn pieces() -> u64 {
    MOVED.load(Ordering::Relaxed)
}
