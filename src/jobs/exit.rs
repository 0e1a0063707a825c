//! How a worker ends: its exit codes, and the time that it takes.

use std::time::Duration;

use nix::sys::signal::Signal;

use crate::failure::FailureKind;
use crate::machine::Kills;

/// Exit code of a worker whose job failed. It said why, and where it would fail again it wrote that
/// to `failure.json`.
pub const FAILED: i32 = 1;
/// Exit code of a worker that was asked to stop.
pub const STOPPED: i32 = 130;
/// Exit code of a worker that was refused memory.
pub const REFUSED_MEMORY: i32 = 12;

/// Time to reach the end of a step and write a checkpoint, once a stop is asked for.
pub const GRACE: Duration = Duration::from_secs(2);

/// Whether a process that a signal ended was ended by others; `None` if it was its own fault. `kills` are those before.
pub fn killed_by(signal: Option<i32>, kills: &Kills) -> Option<FailureKind> {
    const OTHERS: [Signal; 4] = [Signal::SIGKILL, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGINT];
    match OTHERS.into_iter().find(|other| Some(*other as i32) == signal)? {
        Signal::SIGKILL if kills.have_risen() => Some(FailureKind::OutOfMemory),
        _ => Some(FailureKind::Killed),
    }
}
