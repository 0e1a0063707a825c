//! A counter of work done, one a process: how a scheduler tells slow work from work that hangs.
//!
//! Training tells of its steps. What has no steps (reading, tokenising, embedding, measuring) counts
//! each piece that it is done with, so that the counter stands still when the work does.

use std::sync::atomic::{AtomicU64, Ordering};

static MOVED: AtomicU64 = AtomicU64::new(0);

/// A piece of work is done: a clip read, a batch measured.
pub fn moved() {
    MOVED.fetch_add(1, Ordering::Relaxed);
}

/// Pieces done so far.
pub fn pieces() -> u64 {
    MOVED.load(Ordering::Relaxed)
}
