//! `isoflop worker`: one job of a sweep, in a process of its own.

use std::process::exit;

use anyhow::{Result, bail};
use isoflop::record::{JobId, ResultsFolder};
use isoflop::schedule::worker::{
    FAILED, Outcome, STOPPED, claim, forget_progress, stop_with_parent, work, write_failure,
};
use isoflop::schedule::{stop_on_signals, trainer};

use super::args::{GuardArgs, WorkerArgs};
use super::context::device;
use super::exit::Exit;
use super::output::{Output, say};
use super::slurm_worker;

pub fn worker(args: &WorkerArgs, output: &Output) -> Result<Exit> {
    match (args.kind, &args.id) {
        (Some(kind), Some(id)) => one_job(args, &JobId::new(kind, id.as_str())),
        _ if args.fit => slurm_worker::fit(args, output),
        _ if args.chunk.is_some() => slurm_worker::chunk(args),
        _ => bail!("a worker wants a kind of job and an id, or a chunk"),
    }
}

fn one_job(args: &WorkerArgs, job: &JobId) -> Result<Exit> {
    let stop = stop_on_signals()?;
    let folder = ResultsFolder::new(&args.results);
    let place = folder.job(job);
    stop_with_parent(&stop, trainer::grace(&place));
    let device = device(args.device)?;
    let Some(_lock) = claim(&place, &stop)? else { exit(STOPPED) };
    let outcome = work(&folder, job, &device, args.device.name(), &stop);
    forget_progress(&place);
    match outcome {
        Ok(Outcome::Done) => Ok(Exit::Done),
        Ok(Outcome::Stopped) => exit(STOPPED),
        Ok(Outcome::Failed(reason)) => {
            write_failure(&place, &reason)?;
            exit(FAILED)
        }
        Err(error) => {
            say(&format!("error: {error:#}"));
            write_failure(&place, &format!("{error:#}"))?;
            exit(FAILED)
        }
    }
}

/// `isoflop guard`: ends a worker's program when the worker is gone.
pub fn guard(args: &GuardArgs) -> Result<Exit> {
    trainer::guard(&args.lock, &args.mark)?;
    Ok(Exit::Done)
}
