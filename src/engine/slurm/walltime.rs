//! How long a task may still run.

use std::time::{Duration, Instant};

use crate::engine::slurm::command::{QUERY, Shell};
use crate::engine::slurm::settings::Settings;
use crate::sweep::minutes;

/// When the task of this process is over; `None` where it has no limit, or Slurm does not say.
pub fn end(settings: &Settings, shell: &dyn Shell) -> Option<Instant> {
    let id = std::env::var("SLURM_JOB_ID").ok()?;
    let words = settings.program("squeue", &["-h", "-j", &id, "-o", "%L"]);
    let said = shell.ask(&words, QUERY).ok()?;
    let left = minutes(said.lines().next()?)?;
    Instant::now().checked_add(Duration::from_secs_f64(60.0 * left))
}
