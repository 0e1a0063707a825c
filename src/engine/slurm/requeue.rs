//! A task whose time is over puts itself back into the queue, a limited number of times.

use std::path::Path;
use std::{fs, io};

use crate::engine::slurm::command::{QUERY, Shell};
use crate::engine::slurm::ledger::token;
use crate::engine::slurm::settings::Settings;
use crate::files::atomic;

/// Asks Slurm to start this task again, and says so in a sentence; or says why not. Times are counted
/// by files in `folder`, since Slurm's own count is of restarts for every reason.
///
/// # Errors
/// The folder cannot be written to.
pub fn requeue(folder: &Path, settings: &Settings, shell: &dyn Shell) -> io::Result<String> {
    let most = settings.max_requeues();
    let times = fs::read_dir(folder).map_or(0, Iterator::count);
    if times >= most {
        return Ok(format!(
            "the time limit is reached; this task has put itself back into the queue {times} times of {most} \
             that it may, so the rest waits for `isoflop run`"
        ));
    }
    let Some(name) = name() else {
        return Ok("the time limit is reached, and this task does not know its number".to_string());
    };
    atomic::write_json(&folder.join(token()?), &name)?;
    let words = settings.program("scontrol", &["requeue", &name]);
    Ok(match shell.ask(&words, QUERY) {
        Ok(_) => "the time limit is reached; this task is back in the queue and goes on later"
            .to_string(),
        Err(error) => {
            format!("the time limit is reached, and the task could not be requeued: {error}")
        }
    })
}

/// This task, as Slurm names it.
fn name() -> Option<String> {
    let of = |name| std::env::var(name).ok();
    match (of("SLURM_ARRAY_JOB_ID"), of("SLURM_ARRAY_TASK_ID")) {
        (Some(job), Some(index)) => Some(format!("{job}_{index}")),
        _ => of("SLURM_JOB_ID"),
    }
}
