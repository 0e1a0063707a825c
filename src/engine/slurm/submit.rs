//! Gives a submission to Slurm: whole, or not at all.

use std::path::Path;
use std::time::Duration;
use std::{fs, io};

use crate::engine::slurm::command::{QUERY, Shell};
use crate::engine::slurm::error::SlurmError;
use crate::engine::slurm::ledger::{Entry, token};
use crate::engine::slurm::queue::Queue;
use crate::engine::slurm::submission::Submission;
use crate::files::atomic;

/// Times that a call is made that fails for a reason that may pass.
const TRIES: u32 = 3;

/// The first wait between two of them.
const WAIT: Duration = Duration::from_secs(2);

/// Writes what tasks will read, then submits every step after those that it waits for.
///
/// Before each call the ledger says what is to be submitted, by a token that the job carries; after
/// it, the job's number. Where a call fails for good, what this submission gave Slurm before is
/// cancelled, so that nothing is left half wired. What the ledger then holds of it is returned.
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
        match call(&words, submission, &entry, shell) {
            Ok(id) => {
                let entry = Entry { job_id: Some(id), ..entry };
                ledger.write(&entry)?;
                entries.push(entry);
            }
            Err(Failed { error, certain }) => {
                undo(submission, &entries, shell)?;
                if certain {
                    ledger.take_back(&entry)?;
                }
                return Err(error);
            }
        }
    }
    Ok(entries)
}

/// Files first: what Slurm starts finds all that it reads.
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

/// Copies this program to where tasks run it from: a new build would change what is in the queue.
///
/// # Errors
/// The program cannot be read, or the copy not be written.
pub fn keep_program(from: &Path, to: &Path) -> io::Result<()> {
    if to.exists() {
        return Ok(());
    }
    let mut program = fs::File::open(from)?;
    atomic::write_whole(to, |file| io::copy(&mut program, file).map(|_| ()))?;
    make_executable(to)
}

fn make_executable(path: &Path) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    fs::set_permissions(path, fs::Permissions::from_mode(0o755))
}

/// A call that failed, and whether it is certain that no job came of it.
struct Failed {
    error: SlurmError,
    certain: bool,
}

/// Calls `sbatch`; again where the reason may pass, but never without looking whether the job came
/// to be although the answer did not.
fn call(
    words: &[String],
    submission: &Submission,
    entry: &Entry,
    shell: &dyn Shell,
) -> Result<String, Failed> {
    let mut tries = 0;
    loop {
        let error = match shell.ask(words, QUERY).and_then(|said| number(&said)) {
            Ok(id) => return Ok(id),
            Err(error) => error,
        };
        let known_nothing = matches!(error, SlurmError::NotThere { .. });
        let queue = Queue::ask(shell, &submission.written.settings, std::slice::from_ref(entry));
        match queue.map(|queue| queue.tasks.first().map(|task| task.job_id.clone())) {
            Ok(Some(id)) => return Ok(id),
            Ok(None) => {}
            Err(_) => return Err(Failed { error, certain: known_nothing }),
        }
        tries += 1;
        if tries == TRIES || !error.may_pass() {
            return Err(Failed { error, certain: true });
        }
        std::thread::sleep(WAIT * tries);
    }
}

/// The job's number: the last line of what `sbatch --parsable` prints, before a cluster's name. Some
/// sites print a banner before it.
fn number(said: &str) -> Result<String, SlurmError> {
    let last = said.lines().map(str::trim).rfind(|line| !line.is_empty()).unwrap_or_default();
    let id = last.split(';').next().unwrap_or_default();
    let good = !id.is_empty() && id.chars().all(|c| c.is_ascii_digit());
    if good { Ok(id.to_string()) } else { Err(SlurmError::NoNumber(last.to_string())) }
}

/// Cancels what was submitted before a call failed.
fn undo(submission: &Submission, entries: &[Entry], shell: &dyn Shell) -> Result<(), SlurmError> {
    // What waits for others first, lest it begin at their end.
    let ids = entries.iter().rev().filter_map(|entry| entry.job_id.clone());
    let ids: Vec<String> = ids.collect();
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
