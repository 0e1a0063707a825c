//! Packs missing jobs into the arrays of a submission.

use super::cluster::Cluster;
use super::command::{QUERY, Settings, Shell, SlurmError, System, site_defaults};
use super::files::{Entry, Queue, SlurmFolder, token};
use super::stages::{Array, Estimates, Layout, arrays};
use anyhow::{Context, Result, bail};
use std::collections::HashMap;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::{fs, io};

use super::submission::{Submission, SubmissionTerms};
use crate::jobs::gpu::Gpu;
use crate::jobs::{Job, JobId, all_jobs};
use std::time::Duration;

use crate::files::atomic;

/// Assumed FLOPs per second of a GPU before any run has ended on it.
const GPU: f64 = 1e12;

impl Cluster<'_> {
    /// Submits; in fewer and longer tasks, where Slurm takes no more.
    pub fn submit(&self, jobs: &[Job]) -> Result<(u32, Vec<Entry>)> {
        let tell = self.request.tell;
        let rest = "is set in this shell and applies wherever the sweep is silent";
        site_defaults().iter().for_each(|name| tell.note(&format!("{name} {rest}")));
        let program = std::env::current_exe().context("finding this program")?;
        let bytes = fs::read(&program).with_context(|| format!("reading {}", program.display()))?;
        let digest = &blake3::hash(&bytes).to_hex().to_string()[..16];
        let files = SlurmFolder::of(&self.folder);
        keep_program(&program, &files.program(digest)).context("copying this program")?;
        let estimates = self.estimates()?;
        // The user who writes to the folder, by number: the owner of the jobs.
        let user = fs::metadata(self.folder.file("plan.json"))?.uid();
        let mut most = self.settings.max_submit();
        loop {
            let submission = self.submission(jobs, digest, &estimates, most)?;
            let tasks = submission.tasks();
            match submit(&submission, user, &System) {
                Ok(submitted) => return Ok((submission.generation, submitted)),
                Err(error) if error.is_submit_limit() && tasks > 2 => {
                    most = tasks / 2;
                    if tasks == self.submission(jobs, digest, &estimates, most)?.tasks() {
                        return Err(error).context("Slurm takes no more jobs of this user");
                    }
                    tell.note(&format!("{error}; trying again in {most} longer tasks at most"));
                }
                Err(error) => return Err(error).context("nothing of this submission stays"),
            }
        }
    }

    /// The submission, with the program of a digest.
    pub fn submission(
        &self,
        jobs: &[Job],
        program: &str,
        estimates: &Estimates,
        max_tasks: usize,
    ) -> Result<Submission> {
        let folder = &self.folder;
        let reads = all_jobs(self.request.plan).map(|job| (job.id, job.needs));
        let reads: HashMap<JobId, Vec<JobId>> = reads.collect();
        let layout = Layout {
            settings: &self.settings,
            estimates,
            reads: &|id| reads.get(id).cloned().unwrap_or_default(),
            queued: &self.held,
            max_array: self.settings.max_array(self.asked),
            max_tasks,
        };
        let mut steps = arrays(jobs, &layout);
        steps.push(Array::fit());
        let submission = Submission {
            folder: folder.clone(),
            generation: SlurmFolder::of(folder).latest()?.unwrap_or(0) + 1,
            directory: std::env::current_dir().context("finding the current directory")?,
            written: SubmissionTerms {
                settings: self.settings.clone(),
                device: self.request.device.name().to_string(),
                program: program.to_string(),
                flops_per_second: estimates.flops_per_second,
                track: self.request.track,
            },
            steps,
            queued: self.queue.active_jobs(),
        };
        match submission.unspeakable() {
            Some(problem) => bail!(problem),
            None => Ok(submission),
        }
    }

    /// The speed of jobs: by the section, by finished runs, by the card, or by timing a few steps here.
    pub fn estimates(&self) -> Result<Estimates> {
        let (plan, folder) = (self.request.plan, &self.folder);
        let engine = self.request.sweep.engine.as_ref();
        let card = engine.and_then(|engine| Some((engine.card()?, engine.mfu.map(|mfu| mfu.0))));
        let given = self.settings.0.flops_per_second;
        let trainer = self.request.sweep.trainer.as_ref();
        let estimates = match (given, Estimates::of_records(plan, folder)?) {
            (Some(rate), _) => Estimates::given(rate.0),
            (None, Some(measured)) => measured,
            (None, None) if card.is_none() && trainer.is_some_and(|own| own.gpus.is_some()) => {
                Estimates { flops_per_second: GPU, source: UNTIMED }
            }
            (None, None) => match (card, self.request.device) {
                (Some((card, mfu)), _) => {
                    Estimates::of_card(plan, &Gpu::new(card, mfu, plan, folder))
                }
                (None, name) if name.is_processor() => {
                    let probe = Estimates::of_probe(plan, &name.open()?);
                    if trainer.is_some() { Estimates { source: UNTIMED, ..probe } } else { probe }
                }
                (None, _) => Estimates { flops_per_second: GPU, source: "guessed" },
            },
        };
        let Estimates { flops_per_second: rate, source } = &estimates;
        let line = format!("runs are packed by {rate:.2e} FLOPs a second, {source}");
        self.request.tell.note(&line);
        Ok(estimates)
    }
}

/// The rate of a program that is not ours.
const UNTIMED: &str = "guessed, since your trainer has not been timed: flops_per_second says it";

// Gives a submission to Slurm: whole, or not at all.

/// Times that a call is made that fails for a reason that may pass.
const TRIES: u32 = 3;

/// The first wait between two of them.
const WAIT: Duration = Duration::from_secs(2);

/// Writes the files of the tasks, then submits every step after the steps that it waits for.
///
/// Before each call the ledger records the array with a token that the job carries; after it, the job's number. If a
/// call fails for good, the earlier jobs of this submission are cancelled, so that no partial submission is left.
/// Returns the ledger's entries of the submission.
///
/// # Errors
/// Slurm refused, or gave no answer; a file could not be written.
pub fn submit(
    submission: &Submission,
    user: u32,
    shell: &dyn Shell,
) -> Result<Vec<Entry>, SlurmError> {
    write(submission)?;
    let ledger = submission.files();
    let mut entries: Vec<Entry> = Vec::new();
    for step in &submission.steps {
        let entry = Entry {
            generation: submission.generation,
            array: step.name.clone(),
            token: token()?,
            user,
            tasks: step.tasks(),
            job_id: None,
            void: false,
        };
        ledger.write(&entry)?;
        let ids: Vec<String> = entries.iter().filter_map(|entry| entry.job_id.clone()).collect();
        let words = submission.words(step, &entry.token, &ids);
        match call(&words, &submission.written.settings, &entry, shell) {
            Ok(id) => {
                let entry = Entry { job_id: Some(id), ..entry };
                ledger.write(&entry)?;
                entries.push(entry);
            }
            Err((error, is_certain)) => {
                undo(submission, &entries, shell)?;
                if is_certain {
                    ledger.take_back(&entry)?;
                }
                return Err(error);
            }
        }
    }
    Ok(entries)
}

/// Writes all files first, so that tasks find them.
fn write(submission: &Submission) -> io::Result<()> {
    let (files, generation) = (submission.files(), submission.generation);
    for step in &submission.steps {
        for (index, chunk) in step.chunks.iter().enumerate() {
            atomic::write_json(&files.chunk(generation, &step.name, index), chunk)?;
        }
        let script = submission.script(step);
        atomic::write_bytes(&files.script(generation, &step.name), script.as_bytes())?;
    }
    fs::create_dir_all(files.logs())?;
    Ok(atomic::write_json(&files.written(generation), &submission.written)?)
}

/// Copies this program into the folder for tasks: a new build must not affect queued tasks.
///
/// # Errors
/// The program cannot be read, or the copy not be written.
pub fn keep_program(from: &Path, to: &Path) -> io::Result<()> {
    if to.exists() {
        return Ok(());
    }
    let mut program = fs::File::open(from)?;
    atomic::write_whole(to, |file| io::copy(&mut program, file).map(|_| ()))?;
    fs::set_permissions(to, fs::Permissions::from_mode(0o755))
}

/// Calls `sbatch`, with retries for temporary errors, but never without checking whether the job exists although no
/// answer came. An error also says whether it is certain that no job exists.
fn call(
    words: &[String],
    settings: &Settings,
    entry: &Entry,
    shell: &dyn Shell,
) -> Result<String, (SlurmError, bool)> {
    let mut tries = 0;
    loop {
        let error = match shell.ask(words, QUERY).and_then(|said| number(&said)) {
            Ok(id) => return Ok(id),
            Err(error) => error,
        };
        let known_nothing = matches!(error, SlurmError::NotThere { .. });
        let Ok(queue) = Queue::ask(shell, settings, std::slice::from_ref(entry)) else {
            return Err((error, known_nothing));
        };
        if let Some(task) = queue.tasks.first() {
            return Ok(task.job_id.clone());
        }
        tries += 1;
        if tries == TRIES || !error.may_pass() {
            return Err((error, true));
        }
        std::thread::sleep(WAIT * tries);
    }
}

/// The job's number: the last line of `sbatch --parsable`, up to a cluster's name. Some sites print a banner before
/// it.
fn number(said: &str) -> Result<String, SlurmError> {
    let last = said.lines().map(str::trim).rfind(|line| !line.is_empty()).unwrap_or_default();
    let id = last.split(';').next().unwrap_or_default();
    let good = !id.is_empty() && id.chars().all(|c| c.is_ascii_digit());
    if good { Ok(id.to_string()) } else { Err(SlurmError::NoNumber(last.to_string())) }
}

/// Cancels the jobs submitted before a call failed.
fn undo(submission: &Submission, entries: &[Entry], shell: &dyn Shell) -> Result<(), SlurmError> {
    // Waiting jobs first, so that they do not start when others end.
    let ids: Vec<String> = entries.iter().rev().filter_map(|entry| entry.job_id.clone()).collect();
    if ids.is_empty() {
        return Ok(());
    }
    let words = [submission.written.settings.program("scancel", &[]), ids].concat();
    // Where this fails too the entries stay, so that the jobs are known to be ours.
    if shell.ask(&words, QUERY).is_ok() {
        let ledger = submission.files();
        entries.iter().try_for_each(|entry| ledger.take_back(entry))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
