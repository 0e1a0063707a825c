//! Runs the jobs of a Slurm task's chunk, as `isoflop run` would on one machine.

use super::command::{QUERY, Settings, Shell, System};
use super::files::{ChunkFile, SlurmFolder, Timed, token};
use crate::engine::local::{Display, Gpus, LocalPool, LocalProcesses};
use crate::engine::runner::{JobEnd, Runner, Task};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use std::{fs, io};

use super::submission::SubmissionTerms;
use crate::files::{atomic, read_if_there};
use crate::jobs::presence::is_asked_to_end;
use crate::jobs::{Job, JobState, ResultsFolder};
use crate::machine;
use crate::progress::{Beat, Stop};

use crate::failure::Failure;
use crate::sweep::{Stage, minutes};

/// How a task ended; its exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// Everything in the chunk is done.
    Done = 0,
    /// A job failed for good; the others were tried.
    SomeFailed = 1,
    /// It was asked to end, and can resume from checkpoints.
    Interrupted = 75,
    /// An input is missing.
    NoInputs = 78,
}

/// Time for the first files of a task to appear; they contain further settings.
const FIRST_FILES: Duration = Duration::from_secs(90);

/// Time between checks for a request to end.
const LOOK: Duration = Duration::from_millis(50);

/// Time between checks for missing files.
const RELIST: Duration = Duration::from_secs(1);

/// Runs the chunk of a task. `program` is started for each job; `say` writes the log.
///
/// # Errors
/// Files of the submission are damaged or do not appear.
pub fn work(
    folder: &ResultsFolder,
    Task { submission, array, index }: &Task,
    program: PathBuf,
    say: &dyn Fn(&str),
) -> io::Result<Ended> {
    listen()?;
    let files = SlurmFolder::of(folder);
    let SubmissionTerms { settings, device, track, .. } =
        appear(&files.written(*submission), FIRST_FILES)?;
    let path = files.chunk(*submission, array, *index);
    let chunk: ChunkFile = appear(&path, settings.fs_grace())?;
    if let Some(missing) = missing(folder, &chunk, settings.fs_grace()) {
        say(&format!("error: {missing}"));
        return Ok(Ended::NoInputs);
    }
    let sweep = folder.sweep().map_err(io::Error::other)?;
    let is_input = array.starts_with(Stage::Inputs.word());
    let slots = settings.slots(if is_input { Stage::Inputs } else { Stage::Train });
    let guarded = Guarded {
        processes: LocalProcesses {
            folder: folder.clone(),
            device,
            program,
            gpus: Gpus::of_task(&sweep, slots),
            hang: sweep.train.hang(),
            track,
            untracked: OnceLock::new(),
        },
        end: end(&settings),
        chunk: &chunk,
        worked: AtomicBool::new(false),
        out_of_time: AtomicBool::new(false),
    };
    let ended = pool(folder, &guarded, slots);
    guarded.processes.untracked().iter().for_each(|line| say(&format!("warning: {line}")));
    let is_over = is_raised(&guarded.out_of_time) || is_raised(&TIME_IS_UP);
    if ended == Ended::Interrupted && is_over {
        say(&requeue(&files.requeues(*submission, array, *index), &settings)?);
    }
    Ok(ended)
}

/// Runs several jobs in parallel, watching for signals.
fn pool(folder: &ResultsFolder, guarded: &Guarded, slots: usize) -> Ended {
    let jobs = to_do(folder, guarded.chunk);
    let display = Display::new(&jobs, slots, false, || None);
    let (stop, over) = (Stop::default(), AtomicBool::new(false));
    let reports = std::thread::scope(|scope| {
        scope.spawn(|| watch(folder, &stop, &over));
        let pool = LocalPool {
            runner: guarded,
            slots,
            stop: &stop,
            fail_fast: false,
            display: &display,
            memory_bytes: machine::available(),
            timeline: None,
        };
        let reports = pool.execute(jobs);
        over.store(true, Ordering::SeqCst);
        reports
    });
    let is_halted = reports.iter().any(|report| matches!(report.end, JobEnd::Halted(_)));
    let is_stopped = reports.iter().any(|report| report.end == JobEnd::Stopped);
    let is_done = |timed: &Timed| folder.state(&timed.job.id) == JobState::Done;
    match guarded.chunk.jobs.iter().all(is_done) {
        true => Ended::Done,
        false if is_stopped && !is_halted => Ended::Interrupted,
        false => Ended::SomeFailed,
    }
}

/// Raises `stop` when an end is requested, until all jobs have ended.
fn watch(folder: &ResultsFolder, stop: &Stop, over: &AtomicBool) {
    for look in 0.. {
        if is_raised(over) {
            return;
        }
        // The file may lie on another machine: it is looked for less often.
        let is_cancelled = look % 10 == 0 && is_asked_to_end(folder);
        if is_raised(&TIME_IS_UP) || is_raised(&TO_END) || is_cancelled {
            stop.raise();
        }
        std::thread::sleep(LOOK);
    }
}

/// The jobs that are neither done nor lost, each with the needs that are still to be made.
fn to_do(folder: &ResultsFolder, chunk: &ChunkFile) -> Vec<Job> {
    let (mut lost, mut open, mut jobs) = (HashSet::new(), HashSet::new(), Vec::new());
    for timed in &chunk.jobs {
        let mut job = timed.job.clone();
        let state = folder.state(&job.id);
        if state == JobState::Done {
            continue;
        }
        if state == JobState::Failed || job.needs.iter().any(|need| lost.contains(need)) {
            lost.insert(job.id);
            continue;
        }
        job.needs.retain(|need| open.contains(need));
        open.insert(job.id.clone());
        jobs.push(job);
    }
    jobs
}

/// A sentence on missing inputs of the chunk, after the time for them to appear.
fn missing(folder: &ResultsFolder, chunk: &ChunkFile, grace: Duration) -> Option<String> {
    let products = chunk.needs.iter().map(|need| (folder.product(need), Some(need)));
    let own = chunk.jobs.iter().map(|timed| (folder.spec(&timed.job.id), None));
    products.chain(own).find_map(|(path, need)| {
        let failure = || folder.failure(need?).ok().flatten();
        let seen = patiently(&path, grace, || failure().is_some());
        let reason = match failure() {
            Some(_) if path.exists() => return None,
            Some(failure) => format!("{} failed: {}", need?, failure.reason),
            None if seen => return None,
            None => absent(&path, grace),
        };
        Some(format!("an input of this task is missing: {reason}"))
    })
}

/// Reads a file that another machine may have written a moment ago.
fn appear<T: serde::de::DeserializeOwned>(path: &Path, grace: Duration) -> io::Result<T> {
    patiently(path, grace, || false);
    let absent = || io::Error::new(io::ErrorKind::NotFound, absent(path, grace));
    read_if_there(path)?.ok_or_else(absent)
}

fn absent(path: &Path, grace: Duration) -> String {
    format!("{} did not appear within {} s", path.display(), grace.as_secs())
}

/// Waits until a file exists, waiting is useless, or the time is up. Its folder is listed, which clears the cache of a
/// network file system.
fn patiently(path: &Path, grace: Duration, is_in_vain: impl Fn() -> bool) -> bool {
    let started = Instant::now();
    loop {
        if let Some(entries) = path.parent().and_then(|folder| fs::read_dir(folder).ok()) {
            entries.for_each(drop);
        }
        if path.exists() || is_in_vain() {
            return true;
        }
        if started.elapsed() >= grace || is_raised(&TO_END) {
            return false;
        }
        std::thread::sleep(RELIST.min(grace));
    }
}

// Slurm's signals to a task: its time is nearly up (USR2), or it must end (TERM).

/// Whether the warning before the time limit has come.
static TIME_IS_UP: AtomicBool = AtomicBool::new(false);
/// Whether the task was asked to end: cancelled, preempted, or beyond its time.
static TO_END: AtomicBool = AtomicBool::new(false);

fn is_raised(flag: &AtomicBool) -> bool {
    flag.load(Ordering::SeqCst)
}

/// Notes signals from here on. However often they come, the task ends in good order.
///
/// # Errors
/// The system takes no handlers.
fn listen() -> io::Result<()> {
    use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, sigaction};

    extern "C" fn note(signal: i32) {
        let flag = if signal == Signal::SIGUSR2 as i32 { &TIME_IS_UP } else { &TO_END };
        flag.store(true, Ordering::SeqCst);
    }
    let action = SigAction::new(SigHandler::Handler(note), SaFlags::SA_RESTART, SigSet::empty());
    for signal in [Signal::SIGUSR2, Signal::SIGTERM, Signal::SIGINT, Signal::SIGHUP] {
        // SAFETY: the handler does nothing but store to an atomic, which a handler may.
        unsafe { sigaction(signal, &action) }.map_err(io::Error::from)?;
    }
    Ok(())
}

// The remaining time of a task.

/// When the task of this process is over; `None` if it has no limit, or Slurm does not say.
fn end(settings: &Settings) -> Option<Instant> {
    let id = std::env::var("SLURM_JOB_ID").ok()?;
    let words = settings.program("squeue", &["-h", "-j", &id, "-o", "%L"]);
    let said = System.ask(&words, QUERY).ok()?;
    let left = minutes(said.lines().next()?)?;
    Instant::now().checked_add(Duration::from_secs_f64(60.0 * left))
}

// A task whose time is over puts itself back into the queue, a limited number of times.

/// Asks Slurm to start this task again, and says so in a sentence; or says why not. Times are counted
/// by files in `folder`, since Slurm's own count is of restarts for every reason.
///
/// # Errors
/// The folder cannot be written to.
fn requeue(folder: &Path, settings: &Settings) -> io::Result<String> {
    let most = settings.max_requeues();
    let times = fs::read_dir(folder).map_or(0, Iterator::count);
    if times >= most {
        return Ok(format!(
            "the time limit is reached; this task has put itself back into the queue {times} times of {most} \
             that it may, so the rest waits for `isoflop run`"
        ));
    }
    let Some(name) = name() else {
        return Ok("the time limit is reached, and this task does not know its number".to_string());
    };
    atomic::write_json(&folder.join(token()?), &name)?;
    let words = settings.program("scontrol", &["requeue", &name]);
    let what = match System.ask(&words, QUERY) {
        Ok(_) => "; this task is back in the queue and goes on later".to_string(),
        Err(error) => format!(", and the task could not be requeued: {error}"),
    };
    Ok(format!("the time limit is reached{what}"))
}

/// This task, as Slurm names it.
fn name() -> Option<String> {
    let of = |name| std::env::var(name).ok();
    match (of("SLURM_ARRAY_JOB_ID"), of("SLURM_ARRAY_TASK_ID")) {
        (Some(job), Some(index)) => Some(format!("{job}_{index}")),
        _ => of("SLURM_JOB_ID"),
    }
}

// [`Guarded`]: starts no job that the task's time would not do for.

/// Worker processes within a time limit.
pub struct Guarded<'a> {
    pub processes: LocalProcesses,
    /// When the task is over; `None` if it has no limit.
    pub end: Option<Instant>,
    /// The expected time of each job.
    pub chunk: &'a ChunkFile,
    /// Whether a job ended since this task began. One that is longer than any limit must be begun
    /// all the same: it goes on from checkpoints, task after task.
    pub worked: AtomicBool,
    /// Raised when a job was not begun.
    pub out_of_time: AtomicBool,
}

impl Runner for Guarded<'_> {
    fn run(&self, job: &Job, stop: &Stop, beat: &mut dyn FnMut(Beat)) -> JobEnd {
        let timed = self.chunk.jobs.iter().find(|timed| timed.job.id == job.id);
        let left = self.end.map(|end| end.saturating_duration_since(Instant::now()).as_secs_f64());
        let is_short = timed.zip(left).is_some_and(|(timed, left)| left < timed.seconds);
        if is_short && is_raised(&self.worked) {
            self.out_of_time.store(true, Ordering::SeqCst);
            stop.raise();
            return JobEnd::Stopped;
        }
        let end = self.processes.run(job, stop, beat);
        self.worked.fetch_or(end == JobEnd::Done, Ordering::SeqCst);
        end
    }

    fn give_up(&self, job: &Job, failure: Failure) -> Failure {
        self.processes.give_up(job, failure)
    }
}
