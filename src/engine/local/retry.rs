//! Whether a job that ended is started again, and how.

use crate::engine::runner::JobEnd;
use crate::failure::{Failure, FailureKind};

/// Times that a job whose process died is started again.
pub const RETRIES: usize = 2;

/// What becomes of a job whose process has ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    End(JobEnd),
    /// It is started again at once.
    Again,
    /// It is started again when nothing else runs: it took more memory than there was.
    Alone,
    /// It has died too often; this is the failure to note.
    GiveUp(Failure),
}

/// After an end, with this many tries before it.
pub fn next(end: JobEnd, tries: usize, stopping: bool) -> Next {
    match end {
        JobEnd::Stopped if !stopping => {
            let sentence = "the worker was told to stop, and not by its scheduler";
            let killed = Failure::new(FailureKind::Killed, sentence);
            next(JobEnd::Crashed(killed), tries, stopping)
        }
        // A stop may reach a worker before it listens for one.
        JobEnd::Crashed(_) if stopping => Next::End(JobEnd::Stopped),
        JobEnd::Crashed(failure) if tries >= RETRIES => Next::GiveUp(too_often(failure)),
        JobEnd::Crashed(failure) if failure.kind == FailureKind::OutOfMemory => Next::Alone,
        JobEnd::Crashed(_) => Next::Again,
        end => Next::End(end),
    }
}

fn too_often(failure: Failure) -> Failure {
    let times = RETRIES + 1;
    let how = match failure.kind {
        FailureKind::OutOfMemory => "; nothing ran beside it the last time",
        _ => "",
    };
    Failure { reason: format!("{} ({times} times{how})", failure.reason), ..failure }
}
