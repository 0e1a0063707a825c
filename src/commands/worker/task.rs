//! What a cluster's tasks call: `isoflop worker RESULTS --engine E --generation G --stage S --chunk I`,
//! and `--fit` in the end.

use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use isoflop::engine::{FitTerms, Task};
use isoflop::jobs::{FailedJob, ResultsFolder, SweepState};

use super::args::WorkerArgs;
use crate::commands::exit::Exit;
use crate::commands::output::Output;
use crate::commands::screen::say;
use crate::commands::{analyse, status};

/// Does a chunk, and exits with the code that says how it ended.
pub fn chunk(args: &WorkerArgs) -> Result<Exit> {
    let (Some(submission), Some(array), Some(index)) = (args.generation, &args.stage, args.chunk)
    else {
        bail!("a chunk is named by --generation, --stage and --chunk");
    };
    let task = Task { submission, array: array.clone(), index };
    let code = args.engine.task(&ResultsFolder::new(&args.results), &task, &say)?;
    std::process::exit(code)
}

/// Fits the laws, if every run is there, or the sweep may be fitted without.
pub fn fit(args: &WorkerArgs, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    let FitTerms { grace, allow_missing } = args.engine.fit_terms(&folder, args.generation)?;
    let state = wait(&folder, grace)?;
    let missing = state.runs.total() - state.runs.done;
    if missing > 0 {
        output.warn(&incomplete(&folder, &state, missing));
        if !allow_missing || state.runs.done == 0 {
            return Ok(Exit::NotIdentifiable);
        }
    }
    analyse::finish(&folder, output)?;
    Ok(if missing > 0 { Exit::SomeRunsFailed } else { Exit::Done })
}

/// The state once every run is there that can come, or the time is up: what other machines wrote may
/// take a moment to appear.
fn wait(folder: &ResultsFolder, grace: Duration) -> Result<SweepState> {
    let started = Instant::now();
    loop {
        let state = status::state_of(folder)?;
        let runs = &state.runs;
        let to_come = runs.started + runs.missing + runs.running > runs.blocked;
        if !to_come || started.elapsed() >= grace {
            return Ok(state);
        }
        std::thread::sleep(Duration::from_secs(1).min(grace));
    }
}

fn incomplete(folder: &ResultsFolder, state: &SweepState, missing: usize) -> String {
    let runs = &state.runs;
    let reason = |job: &FailedJob| format!("{} ({})", job.label, job.reason);
    let mut text = format!("incomplete: {missing} of {} runs are missing", runs.total());
    let first: Vec<String> = state.failures.iter().take(3).map(reason).collect();
    if !first.is_empty() {
        text += &format!("; failed: {}", first.join("; "));
    }
    text + &format!("; isoflop status {} says more", folder.root().display())
}
