//! What `isoflop run` puts in order before it trains: the folder's files, and what is damaged.

use std::collections::HashSet;
use std::path::Path;

use anyhow::{Result, bail};
use isoflop::plan::Plan;
use isoflop::record::damaged::set_aside;
use isoflop::record::{JobId, JobKind, JobState, ResultsFolder, atomic, os_error, read_if_there};
use isoflop::schedule::{Job, all_jobs};
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::args::RunArgs;
use super::context::OpenSweep;
use super::output::Output;
use super::plan;

/// Writes down what workers read: the resolved sweep, the plan, what each job is to make.
pub fn prepare(open: &OpenSweep, args: &RunArgs, output: &Output) -> Result<()> {
    let OpenSweep { sweep, plan, folder } = open;
    for place in [folder.root(), &folder.file("figures")] {
        atomic::remove_partial(place)?;
    }
    mend(plan, folder, output)?;
    atomic::write_bytes(&folder.file("sweep.yaml"), serde_yaml::to_string(sweep)?.as_bytes())?;
    atomic::write_json(&folder.file("plan.json"), &plan::json(plan, folder))?;
    for job in &plan.tokenizers {
        write_once(&folder.tokenizer(&job.id()).join("job.json"), job, output)?;
    }
    for trunk in &plan.trunks {
        let job = JobId::new(JobKind::Trunk, &trunk.trunk_id);
        // Which trunk it goes on from depends on the sweep's budgets; its result does not.
        atomic::write_json(&folder.job(&job).join("job.json"), trunk)?;
    }
    for run in &plan.runs {
        let path = folder.run(&run.run_id).join("spec.json");
        let is_done = folder.state(&JobId::run(run.run_id.as_str())) == JobState::Done;
        if !is_done || !path.exists() {
            write_once(&path, &run.spec, output)?;
        }
    }
    forget_failures(args, plan, folder)
}

/// Specs lie in folders named by their content, so one that is there is right unless it is damaged,
/// and then it is written again: there is no need to wait for the disk.
fn write_once<T>(path: &Path, value: &T, output: &Output) -> Result<()>
where
    T: Serialize + DeserializeOwned + PartialEq,
{
    match read_if_there::<T>(path) {
        Ok(Some(there)) if there == *value => return Ok(()),
        Ok(None) => {}
        Ok(Some(_)) => output.warn(&format!("{} is not as planned; written again", path.display())),
        Err(error) => output.warn(&format!("{error}: done")),
    }
    Ok(atomic::write_json_unflushed(path, value)?)
}

/// Results that cannot be read are set aside, so that they are made again; each is a warning.
fn mend(plan: &Plan, folder: &ResultsFolder, output: &Output) -> Result<()> {
    let unread = |read: std::io::Result<()>, path| match read {
        Err(error) if os_error(&error.to_string()).is_none() => Some((path, error.to_string())),
        _ => None,
    };
    let runs = plan.runs.par_iter().filter_map(|run| {
        let read = folder.record(&run.run_id).map(|_| ());
        unread(read, folder.run(&run.run_id).join("record.json"))
    });
    let tokenizers = plan.tokenizers.iter().filter_map(|job| {
        let id = job.id();
        unread(folder.metrics(&id).map(|_| ()), folder.tokenizer(&id).join("metrics.json"))
    });
    let damaged: Vec<_> = runs.collect();
    for (path, problem) in damaged.into_iter().chain(tokenizers) {
        set_aside(&path)?;
        output.warn(&format!("{problem}: done"));
    }
    Ok(())
}

/// Takes back the failures that should be tried again.
fn forget_failures(args: &RunArgs, plan: &Plan, folder: &ResultsFolder) -> Result<()> {
    if !args.retry_failed && args.retry.is_empty() {
        return Ok(());
    }
    let jobs: Vec<Job> = all_jobs(plan).collect();
    let forgotten: HashSet<&JobId> = match args.retry_failed {
        true => jobs.iter().map(|job| &job.id).collect(),
        false => with_needs(&jobs, &args.retry)?,
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
