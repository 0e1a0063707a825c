//! How a worker ends: its exit codes, and the time that it takes.

use std::time::Duration;

/// Exit code of a worker whose job failed. It said why, and where it would fail again it wrote that
/// to `failure.json`.
pub const FAILED: i32 = 1;
/// Exit code of a worker that was asked to stop.
pub const STOPPED: i32 = 130;
/// Exit code of a worker that was refused memory.
pub const REFUSED_MEMORY: i32 = 12;

/// Time to reach the end of a step and write a checkpoint, once a stop is asked for.
pub const GRACE: Duration = Duration::from_secs(2);
