//! Patience: how long a worker makes no progress ([`Watch`]), and takes to end ([`Leash`]).
//!
//! Time is counted in the looks of this process: while it is itself stopped (Ctrl-Z, a suspended
//! machine) none passes, so that nobody is blamed for it. No wall clock is read.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ChildStdin;
use std::time::{Duration, Instant};

/// How often a waiting slot looks at its worker.
pub const POLL: Duration = Duration::from_millis(50);
/// A longer pause between two looks is one of this process, not of the worker.
const LOOK: Duration = Duration::from_secs(1);
/// Time beyond a worker's own grace, on a machine that is busy.
const MARGIN: Duration = Duration::from_secs(8);
/// Time for a killed process to be gone; one that waits for a dead disk may never be.
const LAST: Duration = Duration::from_secs(30);

/// Counts time in which this process looks.
struct Patience {
    spent: Duration,
    looked: Instant,
}

impl Patience {
    fn new() -> Self {
        Self { spent: Duration::ZERO, looked: Instant::now() }
    }

    fn spend(&mut self) -> Duration {
        self.spent += self.looked.elapsed().min(LOOK);
        self.looked = Instant::now();
        self.spent
    }
}

/// Whether a worker gets on: by what it says, or by what appears in its log.
pub struct Watch {
    hang: Option<Duration>,
    since: Patience,
    log: PathBuf,
    log_length: u64,
}

impl Watch {
    /// Looks at a worker with this log; without a limit nothing hangs.
    pub fn new(hang: Option<Duration>, log: PathBuf) -> Self {
        let log_length = length(&log);
        Self { hang, since: Patience::new(), log, log_length }
    }

    /// The worker has said that it got on.
    pub fn moved(&mut self) {
        self.since = Patience::new();
    }

    /// Whether nothing has moved for the whole of the limit.
    pub fn has_hung(&mut self) -> bool {
        let Some(limit) = self.hang else { return false };
        // A program of somebody's own may write to its log alone.
        let length = length(&self.log);
        if std::mem::replace(&mut self.log_length, length) != length {
            self.moved();
        }
        self.since.spend() >= limit
    }

    /// The limit.
    pub fn limit(&self) -> Duration {
        self.hang.unwrap_or_default()
    }
}

fn length(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |file| file.len())
}

/// A worker's standard input, which tells it to go on for as long as it is open.
pub struct Leash {
    held: Option<ChildStdin>,
    grace: Duration,
    since: Option<Patience>,
}

impl Leash {
    /// Holds a worker that ends by itself within `grace` once it is let go.
    pub fn new(held: Option<ChildStdin>, grace: Duration) -> Self {
        Self { held, grace, since: None }
    }

    /// Asks the worker to end.
    pub fn let_go(&mut self) {
        self.held = None;
        self.since.get_or_insert_with(Patience::new);
    }

    /// Whether the worker should have ended long ago: it is to be killed.
    pub fn is_overdue(&mut self) -> bool {
        self.outlasts(MARGIN)
    }

    /// Whether not even killing helped.
    pub fn is_given_up(&mut self) -> bool {
        self.outlasts(MARGIN + LAST)
    }

    fn outlasts(&mut self, more: Duration) -> bool {
        let limit = self.grace + more;
        self.since.as_mut().is_some_and(|since| since.spend() > limit)
    }
}
