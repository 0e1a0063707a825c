//! A run that a program of somebody's own trains: `trainer: {command: …}`.
//!
//! The worker writes what is to be trained (`trainer.json`), starts the program beside a guard that
//! outlives the worker, forwards its progress, and checks what it leaves (`result.json`).

mod guard;
mod process;
mod result;
mod spec;

use std::fs;
use std::path::{Path, absolute};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

pub use guard::{GRACE, guard, wake_guard};
pub use result::TrainerResult;
pub use spec::TrainerSpec;

use super::assignment::{Assignment, Outcome};
use super::exit;
use crate::failure::{Failure, FailureKind};
use crate::files::atomic::{remove, write_json};
use crate::files::read_if_there;
use crate::plan::{RunSpec, TrainerProgram};
use crate::sweep::TrainerCommand;

/// How long the worker in `place` waits for an orderly end: longer than a program of its own may.
pub fn grace(place: &Path) -> Duration {
    let spec = read_if_there::<RunSpec>(&place.join("spec.json")).ok().flatten();
    match spec.is_some_and(|spec| spec.trainer.is_some()) {
        true => GRACE + 2 * exit::GRACE,
        false => exit::GRACE,
    }
}

/// Has a program train a run, and writes the record from what it leaves.
pub fn run_program(
    assignment: &Assignment,
    run: &RunSpec,
    trainer: &TrainerProgram,
) -> Result<Outcome> {
    let Assignment { folder, stop, job, .. } = *assignment;
    let id = job.id.as_str();
    let command = TrainerCommand::parse(&trainer.command)?;
    let place = absolute(folder.run(id)).context("naming the run's folder")?;
    let spec = TrainerSpec::new(folder, id, run)?;
    let spec_path = place.join("trainer.json");
    write_json(&spec_path, &spec).context("writing trainer.json")?;
    fs::create_dir_all(&spec.checkpoint).context("making the checkpoint's folder")?;
    remove(&spec.out)?;
    let words = command.fill(|name| {
        let path = match name {
            "spec" => &spec_path,
            "out" => &spec.out,
            _ => &spec.checkpoint,
        };
        path.display().to_string()
    });
    let started = Instant::now();
    let problem = process::attend(&words, &place, id, stop)?;
    let wall_s = started.elapsed().as_secs_f64();
    let result = match problem {
        Some(problem) => Err(problem),
        None => TrainerResult::read(&spec.out)
            .map_err(|problem| Failure::new(FailureKind::Trainer, problem)),
    };
    match result {
        Ok(result) => {
            let record = result.report(&spec, wall_s).record(folder, id, run);
            write_json(&place.join("record.json"), &record).context("writing record.json")?;
            fs::remove_dir_all(&spec.checkpoint).context("removing the checkpoint")?;
            Ok(Outcome::Done)
        }
        Err(_) if stop.is_raised() => Ok(Outcome::Stopped),
        Err(failure) => Ok(Outcome::Failed(failure)),
    }
}
