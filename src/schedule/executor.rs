//! [`Executor`]: who brings the jobs of a plan to their end. [`Runner`]: who does a single one.

use std::fs::{self, OpenOptions};
use std::io::{self, BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use super::job::Job;
use super::signals::Stop;
use super::worker::{Beat, FAILED, STOPPED};
use crate::record::ResultsFolder;

/// How a job ended.
#[derive(Clone, Debug, PartialEq)]
pub enum JobEnd {
    Done,
    /// It would end so again; the reason is in its folder too.
    Failed(String),
    /// It was asked to stop, and goes on from its checkpoint another time.
    Stopped,
    /// Its process died: killed, out of memory. May pass.
    Crashed(String),
}

/// How one job ended.
#[derive(Clone, Debug, PartialEq)]
pub struct JobReport {
    pub job: Job,
    pub end: JobEnd,
}

/// Brings jobs to their end, each after what it needs.
pub trait Executor {
    /// Returns how each job ended; a job whose needs did not come has failed.
    fn execute(&self, jobs: Vec<Job>) -> Vec<JobReport>;
}

/// Does jobs, one call at a time from each of several threads.
pub trait Runner: Sync {
    /// Does a job to its end; `beat` is told how far it is.
    fn run(&self, job: &Job, stop: &Stop, beat: &mut dyn FnMut(Beat)) -> JobEnd;
}

/// A worker process a job, with one thread each, so that runs side by side give the same bits.
pub struct LocalProcesses {
    pub folder: ResultsFolder,
    /// The device's name, as `--device` takes it.
    pub device: String,
    pub program: PathBuf,
}

/// How often a waiting slot looks whether it should stop.
const POLL: Duration = Duration::from_millis(50);

impl Runner for LocalProcesses {
    fn run(&self, job: &Job, stop: &Stop, beat: &mut dyn FnMut(Beat)) -> JobEnd {
        match self.start(job) {
            Ok(child) => self.attend(job, child, stop, beat),
            Err(error) => JobEnd::Crashed(format!("the worker could not be started: {error}")),
        }
    }
}

impl LocalProcesses {
    fn start(&self, job: &Job) -> io::Result<Child> {
        let folder = self.folder.job(&job.id);
        fs::create_dir_all(&folder)?;
        let log = OpenOptions::new().create(true).append(true).open(folder.join("log.txt"))?;
        Command::new(&self.program)
            .arg("worker")
            .arg(self.folder.root())
            .args([job.id.kind.word(), &job.id.id, "--device", &self.device])
            .env("RAYON_NUM_THREADS", "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
    }

    /// Follows a worker to its end. Its standard input is held open for as long as it should work:
    /// when this process asks for a stop, or dies, the worker sees the end of it and stops.
    fn attend(
        &self,
        job: &Job,
        mut child: Child,
        stop: &Stop,
        beat: &mut dyn FnMut(Beat),
    ) -> JobEnd {
        let mut leash = child.stdin.take();
        let beats = read_beats(&mut child);
        loop {
            match beats.recv_timeout(POLL) {
                Ok(one) => beat(one),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if stop.is_raised() {
                leash = None;
            }
        }
        drop(leash);
        match child.wait() {
            Ok(status) => self.end(job, status),
            Err(error) => JobEnd::Crashed(error.to_string()),
        }
    }

    fn end(&self, job: &Job, status: std::process::ExitStatus) -> JobEnd {
        match status.code() {
            Some(0) => JobEnd::Done,
            Some(STOPPED) => JobEnd::Stopped,
            Some(FAILED) => match self.folder.failure(&job.id) {
                Ok(Some(failure)) => JobEnd::Failed(failure.reason),
                _ => JobEnd::Crashed("the worker failed and left no reason".to_string()),
            },
            _ => JobEnd::Crashed(format!("the worker ended with {status}")),
        }
    }
}

/// The lines that a worker prints, as they come; the channel closes when the worker ends.
fn read_beats(child: &mut Child) -> mpsc::Receiver<Beat> {
    let (sender, receiver) = mpsc::channel();
    let output = child.stdout.take().expect("stdout is piped");
    std::thread::spawn(move || {
        for line in BufReader::new(output).lines().map_while(Result::ok) {
            if let Ok(beat) = serde_json::from_str(&line)
                && sender.send(beat).is_err()
            {
                break;
            }
        }
    });
    receiver
}
