//! What `isoflop run` puts in order before it trains: the folder's files, and what is damaged.

use std::collections::HashSet;

use anyhow::{Result, bail};
use isoflop::files::damaged::set_aside;
use isoflop::files::{FileError, atomic};
use isoflop::jobs::{Job, JobId, ResultsFolder, all_jobs, write_specs};
use isoflop::plan::Plan;
use rayon::prelude::*;

use super::args::RunArgs;
use crate::commands::context::OpenSweep;
use crate::commands::output::Output;
use crate::commands::plan;

/// Writes down what workers read: the resolved sweep, the plan, what each job is to make.
pub fn prepare(open: &OpenSweep, args: &RunArgs, output: &Output) -> Result<()> {
    let OpenSweep { sweep, plan, folder } = open;
    for place in [folder.root(), &folder.file("figures")] {
        atomic::remove_partial(place)?;
    }
    mend(plan, folder, output)?;
    atomic::write_bytes(&folder.file("sweep.yaml"), serde_yaml::to_string(sweep)?.as_bytes())?;
    let document = plan::json(plan, folder, &folder.run_states());
    atomic::write_json(&folder.file("plan.json"), &document)?;
    write_specs(plan, folder, &mut |line| output.warn(&line))?;
    forget_failures(args, plan, folder)
}

/// Results that cannot be read are set aside, so that they are made again; each is a warning.
fn mend(plan: &Plan, folder: &ResultsFolder, output: &Output) -> Result<()> {
    let jobs: Vec<Job> = all_jobs(plan).collect();
    let damaged = |job: &Job| match folder.inspect(&job.id) {
        Err(error @ FileError::Damaged { .. }) => Some((folder.product(&job.id), error)),
        _ => None,
    };
    let damaged: Vec<_> = jobs.par_iter().filter_map(damaged).collect();
    for (path, problem) in damaged {
        set_aside(&path)?;
        output.warn(&format!("{problem}: done"));
    }
    Ok(())
}

/// Takes back the failures that should be tried again.
fn forget_failures(args: &RunArgs, plan: &Plan, folder: &ResultsFolder) -> Result<()> {
    if !args.options.retry_failed && args.options.retry.is_empty() {
        return Ok(());
    }
    let jobs: Vec<Job> = all_jobs(plan).collect();
    let forgotten: HashSet<&JobId> = match args.options.retry_failed {
        true => jobs.iter().map(|job| &job.id).collect(),
        false => with_needs(&jobs, &args.options.retry)?,
    };
    for job in forgotten {
        atomic::remove(&folder.job(job).join("failure.json"))?;
    }
    Ok(())
}

/// The jobs of these ids and all that they need; each stands after what it needs.
fn with_needs<'a>(jobs: &'a [Job], ids: &[String]) -> Result<HashSet<&'a JobId>> {
    if let Some(id) = ids.iter().find(|id| jobs.iter().all(|job| job.id.id != **id)) {
        bail!(
            "--retry {id}: the sweep has no job of this id; `isoflop status` names those that failed"
        );
    }
    let mut wanted = HashSet::new();
    for job in jobs.iter().rev() {
        if ids.contains(&job.id.id) || wanted.contains(&job.id) {
            wanted.insert(&job.id);
            wanted.extend(&job.needs);
        }
    }
    Ok(wanted)
}
