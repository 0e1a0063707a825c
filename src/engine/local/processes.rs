//! [`LocalProcesses`]: one watched worker process per job.

use super::gpus::{Gpus, VISIBLE};
use super::traces::Curve;
use crate::engine::runner::{JobEnd, Runner, Track};
use crate::failure::{Failure, FailureKind};
use crate::files::{self, FileError};
use crate::jobs::worker::{FAILED, REFUSED_MEMORY, STOPPED, killed_by, last_lines, write_failure};
use crate::jobs::{Job, JobKind, ResultsFolder, program};
use crate::machine::Kills;
use crate::progress::{Beat, Said, Stop};
use nix::sys::signal::Signal;
use std::env;
use std::fs::{self, OpenOptions};
use std::io::{self, BufRead, BufReader};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

/// How a worker's allocator, mimalloc, deals with the system, unless the user says otherwise: it returns no freed memory
/// (-1 ms), since each step of training wants the same again, and asks for pages of 2 MiB where there are any.
const ALLOCATOR: [(&str, &str); 2] =
    [("MIMALLOC_PURGE_DELAY", "-1"), ("MIMALLOC_ALLOW_LARGE_OS_PAGES", "1")];

/// A worker process a job, with one thread each, so that runs side by side give the same bits.
pub struct LocalProcesses {
    pub folder: ResultsFolder,
    /// The device's name, as `--device` takes it.
    pub device: String,
    pub program: PathBuf,
    /// GPUs that are shared out among the workers of runs.
    pub gpus: Option<Gpus>,
    /// A worker that makes no progress for this long is ended; `None`: it is waited for.
    pub hang: Option<Duration>,
    /// The tracker that follows runs, if one does.
    pub track: Option<Track>,
    /// Why the tracker's files are not complete: the first problem.
    pub untracked: OnceLock<String>,
}

impl Runner for LocalProcesses {
    fn run(&self, job: &Job, stop: &Stop, beat: &mut dyn FnMut(Beat)) -> JobEnd {
        if let Some(gone) = self.gone() {
            return gone;
        }
        let place = self.folder.job(&job.id);
        let gpus = self.gpus.as_ref().filter(|_| job.id.kind == JobKind::Run).map(Gpus::lend);
        let mut curve = self.curve(job);
        let mut beat = |one: Beat| {
            curve.iter_mut().for_each(|curve| curve.beat(&one));
            beat(one);
        };
        let list = gpus.as_ref().map(|lent| lent.list.as_str());
        let mut end = match Attended::start(self, job, &place, list) {
            Ok(worker) => worker.attend(stop, &mut beat),
            Err(error) => {
                let kind = files::failure_kind(&error).unwrap_or(FailureKind::Crashed);
                JobEnd::of(Failure::new(kind, format!("the worker could not be started: {error}")))
            }
        };
        if let Some(mut curve) = curve {
            if end == JobEnd::Done {
                curve.done();
            }
            if let Some(problem) = curve.problem {
                // The first is reported.
                let _ = self.untracked.set(problem);
            }
        }
        if let Some(gone) = end.failure().and_then(|_| self.gone()) {
            return gone;
        }
        // The failure of a killed worker, which could not report it.
        if let JobEnd::Crashed(failure) | JobEnd::Halted(failure) = &mut end
            && failure.last_lines.is_empty()
        {
            failure.last_lines = last_lines(&place);
        }
        end
    }

    fn give_up(&self, job: &Job, failure: Failure) -> Failure {
        match write_failure(&self.folder.job(&job.id), &failure) {
            Ok(()) => failure,
            Err(error) => Failure::new(error.failure_kind(), error.to_string()),
        }
    }
}

impl LocalProcesses {
    /// The end of every job of a sweep whose folder is not there any more.
    fn gone(&self) -> Option<JobEnd> {
        let sentence = || format!("{} was removed or renamed", self.folder.root().display());
        let is_gone = !self.folder.file("sweep.yaml").exists();
        is_gone.then(|| JobEnd::of(Failure::new(FailureKind::FolderGone, sentence())))
    }

    /// The TensorBoard file of a run or a trunk, if tracking is on.
    fn curve<'a>(&'a self, job: &'a Job) -> Option<Curve<'a>> {
        let is_written = self.track == Some(Track::Tensorboard);
        let is_training = matches!(job.id.kind, JobKind::Trunk | JobKind::Run);
        (is_written && is_training).then(|| Curve::new(&self.folder, job))
    }

    /// A single warning if the tracker missed something.
    pub fn untracked(&self) -> Option<String> {
        let problem = self.untracked.get()?;
        Some(format!("--track tensorboard: not all of the curves could be written: {problem}"))
    }
}

/// A running worker.
struct Attended<'a> {
    job: &'a Job,
    runner: &'a LocalProcesses,
    place: &'a Path,
    child: Child,
    said: mpsc::Receiver<Said>,
    /// Processes that the system had killed for memory when it began.
    kills: Kills,
    /// The failure that it reported.
    failure: Option<Failure>,
    last_beat: Option<Beat>,
}

impl<'a> Attended<'a> {
    /// Starts a worker, which sees only the given GPUs, if any.
    fn start(
        runner: &'a LocalProcesses,
        job: &'a Job,
        place: &'a Path,
        gpus: Option<&str>,
    ) -> io::Result<Self> {
        fs::create_dir_all(place).map_err(FileError::write(place))?;
        let path = place.join("log.txt");
        let log = OpenOptions::new().create(true).append(true).open(&path);
        let log = log.map_err(FileError::write(&path))?;
        let kills = Kills::so_far();
        let mut command = Command::new(&runner.program);
        if let Some(gpus) = gpus {
            command.env(VISIBLE, gpus);
        }
        if let Some(track) = runner.track {
            command.envs(track.variables(runner.folder.name()));
        }
        let mut child = command
            .arg("worker")
            .arg(runner.folder.root())
            .args([job.id.kind.word(), &job.id.id, "--device", &runner.device])
            .env("RAYON_NUM_THREADS", "1")
            .envs(ALLOCATOR.into_iter().filter(|(name, _)| env::var_os(name).is_none()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()?;
        tracing::info!(job = %job.id, label = job.label, pid = child.id(), "worker started");
        let said = read_words(&mut child).inspect_err(|_| {
            let _ = child.kill();
            let _ = child.wait();
        })?;
        let (failure, last_beat) = (None, None);
        Ok(Self { job, runner, place, child, said, kills, failure, last_beat })
    }

    /// Follows a worker to its end. Its standard input stays open as long as it should work: if this process asks for a
    /// stop, or dies, the worker sees the end of it and stops.
    fn attend(mut self, stop: &Stop, beat: &mut dyn FnMut(Beat)) -> JobEnd {
        let mut watch = Watch::new(self.runner.hang, self.place.join("log.txt"));
        let grace = program::grace(&self.runner.folder, &self.job.id);
        let mut leash = Leash { held: self.child.stdin.take(), grace, since: None };
        let mut hung = None;
        loop {
            match self.said.recv_timeout(POLL) {
                Ok(word) => {
                    watch.since = Patience::new();
                    match word {
                        Said::Beat(one) => {
                            self.last_beat = Some(one);
                            beat(one);
                        }
                        Said::Failure(failure) => self.failure = Some(failure),
                        Said::Moved { .. } => {}
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if hung.is_none() {
                hung = watch.hung().map(|limit| self.hung(limit));
            }
            if stop.is_raised() || hung.is_some() {
                leash.let_go();
            }
            if leash.outlasts(MARGIN) {
                let _ = self.child.kill();
                program::wake_guard(self.place);
            }
            // Not even killing helped.
            if leash.outlasts(MARGIN + LAST) {
                return hung.map_or(JobEnd::Stopped, JobEnd::of);
            }
        }
        drop(leash);
        match self.child.wait() {
            Ok(status) => {
                tracing::info!(job = %self.job.id, %status, "worker ended");
                self.end(status, hung, stop)
            }
            Err(error) => JobEnd::Crashed(Failure::new(FailureKind::Crashed, error.to_string())),
        }
    }

    fn hung(&self, limit: Duration) -> Failure {
        let after = match self.last_beat {
            Some(Beat { step, steps, .. }) => format!("after step {step} of {steps}"),
            None => "before its first step".to_string(),
        };
        let seconds = limit.as_secs_f64();
        let sentence = format!("no progress for {seconds} s (train.hang_s) {after}; it was ended");
        Failure::new(FailureKind::Hung, sentence)
    }

    fn end(self, status: ExitStatus, hung: Option<Failure>, stop: &Stop) -> JobEnd {
        match (status.code(), hung) {
            (Some(0), _) => JobEnd::Done,
            (_, Some(hung)) => JobEnd::of(hung),
            (Some(STOPPED), None) => JobEnd::Stopped,
            (Some(FAILED), None) => {
                let written = || self.runner.folder.failure(&self.job.id).ok().flatten();
                let silent = "the worker failed and left no reason";
                let silent = || Failure::new(FailureKind::Crashed, silent);
                JobEnd::of(self.failure.or_else(written).unwrap_or_else(silent))
            }
            // It was ended by this process, or did not listen yet.
            (None, None) if stop.is_raised() => JobEnd::Stopped,
            (_, None) => JobEnd::of(death(status, &self.kills)),
        }
    }
}

/// Why a worker died that said nothing; `kills` are those before it began.
fn death(status: ExitStatus, kills: &Kills) -> Failure {
    if status.code() == Some(REFUSED_MEMORY) {
        return Failure::new(FailureKind::OutOfMemory, "the worker was refused memory");
    }
    let kind = match status.signal() {
        Some(signal) if signal == Signal::SIGBUS as i32 => FailureKind::FilesChanged,
        signal => killed_by(signal, kills).unwrap_or(FailureKind::Crashed),
    };
    let sentence = match kind {
        FailureKind::OutOfMemory => {
            "the system was out of memory and killed the worker".to_string()
        }
        FailureKind::Killed => format!("the worker was killed: {status}"),
        FailureKind::FilesChanged => {
            format!("a file was cut short while the worker read it, which ended it with {status}")
        }
        _ => format!("the worker ended with {status}"),
    };
    Failure::new(kind, sentence)
}

/// The output of a worker, line by line; the channel closes when the worker ends.
fn read_words(child: &mut Child) -> io::Result<mpsc::Receiver<Said>> {
    let (sender, receiver) = mpsc::channel();
    let output = child.stdout.take().expect("stdout is piped");
    std::thread::Builder::new().spawn(move || {
        for line in BufReader::new(output).lines().map_while(Result::ok) {
            if let Ok(word) = serde_json::from_str(&line)
                && sender.send(word).is_err()
            {
                break;
            }
        }
    })?;
    Ok(receiver)
}

// Timeouts: for progress ([`Watch`]) and for ending ([`Leash`]).
//
// Time is counted in polls of this process: while it is stopped (Ctrl-Z, a suspended machine) no time passes, so no
// worker is blamed. No wall clock is read.

/// Time between polls of a worker.
const POLL: Duration = Duration::from_millis(50);
/// A longer pause between two looks is one of this process, not of the worker.
const LOOK: Duration = Duration::from_secs(1);
/// Time beyond a worker's own grace, on a machine that is busy.
const MARGIN: Duration = Duration::from_secs(8);
/// Time for a killed process to be gone; one that waits for a dead disk may never be.
const LAST: Duration = Duration::from_secs(30);

/// Counts time in which this process looks.
struct Patience {
    spent: Duration,
    looked: Instant,
}

impl Patience {
    fn new() -> Self {
        Self { spent: Duration::ZERO, looked: Instant::now() }
    }

    fn spend(&mut self) -> Duration {
        self.spent += self.looked.elapsed().min(LOOK);
        self.looked = Instant::now();
        self.spent
    }
}

/// Detects progress of a worker, by its messages or by its log.
struct Watch {
    hang: Option<Duration>,
    since: Patience,
    log: PathBuf,
    log_length: u64,
}

impl Watch {
    /// Watches a worker with this log; without a limit nothing counts as hung.
    fn new(hang: Option<Duration>, log: PathBuf) -> Self {
        let log_length = length(&log);
        Self { hang, since: Patience::new(), log, log_length }
    }

    /// The limit, if nothing has moved for the whole of it.
    fn hung(&mut self) -> Option<Duration> {
        let limit = self.hang?;
        // A user's trainer may write only to its log.
        let length = length(&self.log);
        if std::mem::replace(&mut self.log_length, length) != length {
            self.since = Patience::new();
        }
        (self.since.spend() >= limit).then_some(limit)
    }
}

fn length(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |file| file.len())
}

/// A worker's standard input; the worker runs as long as it is open.
struct Leash {
    held: Option<ChildStdin>,
    /// The worker ends by itself within it, once it is let go.
    grace: Duration,
    /// When it was let go.
    since: Option<Patience>,
}

impl Leash {
    /// Asks the worker to end.
    fn let_go(&mut self) {
        self.held = None;
        self.since.get_or_insert_with(Patience::new);
    }

    /// Whether it goes on for so much longer than its grace.
    fn outlasts(&mut self, more: Duration) -> bool {
        let limit = self.grace + more;
        self.since.as_mut().is_some_and(|since| since.spend() > limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worker_whose_file_was_cut_starts_again_and_says_why() {
        let failure = death(ExitStatus::from_raw(Signal::SIGBUS as i32), &Kills::so_far());
        assert!(failure.reason.contains("a file was cut short while the worker read it"));
        assert!(matches!(JobEnd::of(failure), JobEnd::Crashed(Failure { kind, .. })
            if kind == FailureKind::FilesChanged));
        let failure = death(ExitStatus::from_raw(Signal::SIGSEGV as i32), &Kills::so_far());
        assert_eq!(failure.kind, FailureKind::Crashed);
    }
}
