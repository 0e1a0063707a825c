//! `isoflop worker`: runs one job of a sweep in its own process.

use super::context::{an_engine, device};
use super::output::say;
use super::prelude::*;
use super::{analyse, status};
use isoflop::engine::{ENGINES, Engine, FitTerms, Task};
use isoflop::jobs::presence::claim;
use isoflop::jobs::worker::{
    FAILED, REFUSED_MEMORY, STOPPED, failure_of, report_failure, stop_with_parent,
};
use isoflop::jobs::{Assignment, FailedJob, JobId, JobKind, Outcome, SweepState, program, work};
use isoflop::machine::exit_when_refused;
use isoflop::ops::{DeviceName, check_products};
use isoflop::progress::{forget_progress, stop_on_signals, tell_of_pieces};
use std::process::exit;
use std::time::{Duration, Instant};

pub fn worker(args: &WorkerArgs, output: &Output) -> Result<Exit> {
    match (args.kind, &args.id) {
        (Some(kind), Some(id)) => one_job(args, &JobId::new(kind, id.as_str())),
        _ if args.fit => fit(args, output),
        _ if args.chunk.is_some() => chunk(args),
        _ => bail!("a worker wants a kind of job and an id, or a chunk"),
    }
}

fn one_job(args: &WorkerArgs, job: &JobId) -> Result<Exit> {
    exit_when_refused(REFUSED_MEMORY);
    let stop = stop_on_signals()?;
    let folder = ResultsFolder::new(&args.results);
    let place = folder.job(job);
    stop_with_parent(&stop, program::grace(&folder, job));
    tell_of_pieces();
    let device = args.device.open()?;
    let device_name = args.device.name();
    let assignment = Assignment { folder: &folder, job, device: &device, device_name, stop: &stop };
    let claimed = claim(&place, &stop);
    let outcome = match &claimed {
        Ok(None) => exit(STOPPED),
        // CPUs multiply correctly; other devices are checked.
        Ok(Some(_lock)) if args.device.is_processor() => work(&assignment),
        Ok(Some(_lock)) => {
            check_products(&device).map_err(Into::into).and_then(|()| work(&assignment))
        }
        Err(error) => Ok(Outcome::Failed(failure_of(error))),
    };
    let failure = match outcome {
        Ok(Outcome::Done) => None,
        Ok(Outcome::Failed(failure)) => Some(failure),
        // A job that ends while it is asked to stop may not have failed; if it did, it will fail again. Its
        // progress is kept.
        Ok(Outcome::Stopped) => exit(STOPPED),
        Err(error) if stop.is_raised() => {
            say(&format!("stopped: {error:#}"));
            exit(STOPPED)
        }
        Err(error) => {
            say(&format!("error: {error:#}"));
            Some(failure_of(&error))
        }
    };
    forget_progress(&place);
    if let Some(failure) = failure {
        report_failure(&place, failure);
        exit(FAILED)
    }
    Ok(Exit::Done)
}

/// `isoflop guard`: ends a worker's program when the worker is gone.
pub fn guard(args: &GuardArgs) -> Result<Exit> {
    program::guard(&args.lock, &args.mark)?;
    Ok(Exit::Done)
}

// Called by a cluster's tasks: `isoflop worker RESULTS --engine E --generation G --stage S --chunk I`, and `--fit`
// at the end.

/// Runs a chunk, and returns its exit code.
fn chunk(args: &WorkerArgs) -> Result<Exit> {
    let (Some(submission), Some(array), Some(index)) = (args.generation, &args.stage, args.chunk)
    else {
        bail!("a chunk is named by --generation, --stage and --chunk");
    };
    let task = Task { submission, array: array.clone(), index };
    let code = args.engine.task(&ResultsFolder::new(&args.results), &task, &say)?;
    exit(code)
}

/// Fits the laws if every run is done, or if the sweep allows missing runs.
fn fit(args: &WorkerArgs, output: &Output) -> Result<Exit> {
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

/// The state once every run that can still finish has, or the time is up: files of other machines may take a
/// moment to appear.
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

// The arguments of `isoflop worker` and `isoflop guard`, which other commands call.

#[derive(Args)]
pub struct WorkerArgs {
    pub results: PathBuf,
    #[arg(required_unless_present_any = ["chunk", "fit"], requires = "id")]
    pub kind: Option<JobKind>,
    pub id: Option<String>,
    /// The engine of a submission
    #[arg(long, value_parser = an_engine(), default_value = ENGINES[0].name())]
    pub engine: &'static dyn Engine,
    /// A submission, for --chunk and --fit
    #[arg(long)]
    pub generation: Option<u32>,
    /// An array of it
    #[arg(long)]
    pub stage: Option<String>,
    /// A task of the array: do its jobs
    #[arg(long, conflicts_with = "kind", requires_all = ["generation", "stage"])]
    pub chunk: Option<usize>,
    /// Fit the laws
    #[arg(long, conflicts_with_all = ["kind", "chunk"])]
    pub fit: bool,
    #[arg(long, value_parser = device(), default_value = "flex")]
    pub device: DeviceName,
}

#[derive(Args)]
pub struct GuardArgs {
    /// Locked for as long as a program of the run may live
    pub lock: PathBuf,
    /// The variable in the program's environment
    pub mark: String,
}
