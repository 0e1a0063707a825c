//! What tasks of Slurm's call: `isoflop worker RESULTS --generation G --stage S --chunk I`, and
//! `--fit` in the end.

use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use isoflop::record::{ResultsFolder, read_if_there};
use isoflop::schedule::SweepState;
use isoflop::slurm::worker::Place;
use isoflop::slurm::{Settings, SlurmFolder, System, Written};

use super::args::WorkerArgs;
use super::exit::Exit;
use super::output::{Output, say};
use super::{analyse, status};

/// Does a chunk, and exits with the code that says how it ended.
pub fn chunk(args: &WorkerArgs) -> Result<Exit> {
    let (Some(generation), Some(array), Some(index)) = (args.generation, &args.stage, args.chunk)
    else {
        bail!("a chunk is named by --generation, --stage and --chunk");
    };
    let folder = ResultsFolder::new(&args.results);
    let place = Place { folder, generation, array: array.clone(), index };
    let program = std::env::current_exe().context("finding this program")?;
    let ended = place.work(program, &System, &say)?;
    std::process::exit(ended as i32)
}

/// Fits the laws, if every run is there, or the sweep may be fitted without.
pub fn fit(args: &WorkerArgs, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    let files = SlurmFolder::of(&folder);
    let written = match args.generation {
        Some(generation) => read_if_there::<Written>(&files.written(generation))?,
        None => None,
    };
    let settings = Settings::new(written.map(|written| written.settings).unwrap_or_default());
    let state = wait(&folder, settings.fs_grace())?;
    let missing = state.runs.total() - state.runs.done;
    if missing > 0 {
        output.warn(&incomplete(&folder, &state, missing));
        if !settings.allow_missing() || state.runs.done == 0 {
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
    let mut text = format!("incomplete: {missing} of {} runs are missing", runs.total());
    let first: Vec<String> = state.failures.iter().take(3).map(reason).collect();
    if !first.is_empty() {
        text += &format!("; failed: {}", first.join("; "));
    }
    text + &format!("; isoflop status {} says more", folder.root().display())
}

fn reason(job: &isoflop::schedule::FailedJob) -> String {
    format!("{} ({})", job.label, job.reason)
}
