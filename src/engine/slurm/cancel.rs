//! Ends what Slurm does for a sweep: first what waits, then, with time for checkpoints, what runs.

use std::time::{Duration, Instant};

use crate::engine::Cancelled;
use crate::engine::slurm::command::{QUERY, Shell};
use crate::engine::slurm::error::SlurmError;
use crate::engine::slurm::ledger::Entry;
use crate::engine::slurm::queue::Queue;
use crate::engine::slurm::settings::Settings;
use crate::jobs::ResultsFolder;
use crate::jobs::presence::{ask_no_more, ask_to_end};

const POLL: Duration = Duration::from_millis(500);

/// How long what was killed may take to go.
const KILLED: Duration = Duration::from_secs(60);

/// Ends the jobs of the entries, by their numbers alone.
///
/// # Errors
/// Slurm gave no answer: then nothing is known, and the sweep may go on.
pub fn cancel(
    folder: &ResultsFolder,
    settings: &Settings,
    entries: &[Entry],
    shell: &dyn Shell,
) -> Result<Cancelled, SlurmError> {
    let look = || Queue::ask(shell, settings, entries);
    if !look()?.is_active() {
        return Ok(Cancelled::NothingRan);
    }
    // Tasks look for this too: one may be starting just now.
    ask_to_end(folder)?;
    let call = |arguments: &[&str], ids: Vec<String>| {
        let words = [settings.program("scancel", arguments), ids].concat();
        // A job that has ended meanwhile is no error.
        shell.call(&words, QUERY)
    };
    let mut asked = false;
    let gone = until(settings.cancel_grace(), || {
        let queue = look()?;
        let ids = queue.active_jobs();
        if ids.is_empty() {
            return Ok(true);
        }
        // What waits first: the fit would begin at the end of what it waits for.
        call(&["--state=PENDING"], ids.clone())?;
        if !asked {
            call(&["--batch", "--signal=TERM"], ids)?;
            asked = true;
        }
        Ok(false)
    })?;
    let killed = !gone && {
        call(&[], look()?.active_jobs())?;
        until(KILLED, || Ok(!look()?.is_active()))?
    };
    ask_no_more(folder)?;
    Ok(match (gone, killed) {
        (true, _) => Cancelled::Ended,
        (false, true) => Cancelled::Killed,
        (false, false) => Cancelled::StillAtWork,
    })
}

fn until(
    limit: Duration,
    mut look: impl FnMut() -> Result<bool, SlurmError>,
) -> Result<bool, SlurmError> {
    let started = Instant::now();
    loop {
        if look()? {
            return Ok(true);
        }
        if started.elapsed() > limit {
            return Ok(false);
        }
        std::thread::sleep(POLL);
    }
}
