//! `isoflop worker`: one job of a sweep, in a process of its own.

mod args;
mod task;

use std::process::exit;

use anyhow::{Result, bail};
use burn::tensor::Device;
use isoflop::jobs::program;
use isoflop::jobs::worker::{
    FAILED, REFUSED_MEMORY, STOPPED, claim, failure_of, report_failure, stop_with_parent, work,
};
use isoflop::jobs::{Assignment, Outcome};
use isoflop::jobs::{JobId, ResultsFolder};
use isoflop::machine::allocator::exit_when_refused;
use isoflop::ops::{DeviceName, check_products};
use isoflop::progress::stop_on_signals;
use isoflop::progress::{forget_progress, tell_of_pieces};

use crate::commands::exit::Exit;
use crate::commands::output::Output;
use crate::commands::screen::say;

pub use args::{GuardArgs, WorkerArgs};

pub fn worker(args: &WorkerArgs, output: &Output) -> Result<Exit> {
    match (args.kind, &args.id) {
        (Some(kind), Some(id)) => one_job(args, &JobId::new(kind, id.as_str())),
        _ if args.fit => task::fit(args, output),
        _ if args.chunk.is_some() => task::chunk(args),
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
        Ok(Some(_lock)) => checked(args.device, &device).and_then(|()| work(&assignment)),
        Err(error) => Ok(Outcome::Failed(failure_of(error))),
    };
    let failure = match outcome {
        Ok(Outcome::Done) => None,
        Ok(Outcome::Failed(failure)) => Some(failure),
        // What ends while it is asked to may not have failed; if it has, it will again. How far it
        // was stays noted.
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

/// Processors multiply; of other devices it must be seen.
fn checked(name: DeviceName, device: &Device) -> Result<()> {
    if name.is_processor() { Ok(()) } else { Ok(check_products(device)?) }
}

/// `isoflop guard`: ends a worker's program when the worker is gone.
pub fn guard(args: &GuardArgs) -> Result<Exit> {
    program::guard(&args.lock, &args.mark)?;
    Ok(Exit::Done)
}
