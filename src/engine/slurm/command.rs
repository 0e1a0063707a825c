//! [`Shell`]: calls the programs of Slurm. [`System`] is the real one; tests have their own.

use crate::files::FileError;
use crate::sweep::{Amount, Count, Resources, SlurmSection, Stage, Word, minutes};
use serde::{Deserialize, Serialize};
use std::io::{self, Read};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How a program ended.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Answer {
    pub ok: bool,
    pub stdout: String,
    pub stderr: String,
}

/// Calls programs.
pub trait Shell {
    /// Calls the program that the first word names and waits for its end, for `patience` at most.
    ///
    /// # Errors
    /// [`SlurmError::NotThere`] and [`SlurmError::Silent`]; a program that fails is no error.
    fn call(&self, words: &[String], patience: Duration) -> Result<Answer, SlurmError>;

    /// [`Shell::call`] of a program that must succeed; its standard output.
    ///
    /// # Errors
    /// Also [`SlurmError::Refused`], with the program's message.
    fn ask(&self, words: &[String], patience: Duration) -> Result<String, SlurmError> {
        let answer = self.call(words, patience)?;
        if answer.ok {
            return Ok(answer.stdout);
        }
        let said = answer.stderr.lines().map(str::trim).collect::<Vec<_>>().join("; ");
        Err(SlurmError::Refused { program: words[0].clone(), said })
    }
}

/// Timeout of a query.
pub const QUERY: Duration = Duration::from_secs(60);

/// Environment variables that would break a submission: `sbatch` would wait for the job, write elsewhere, or get
/// contradicting options.
const UNWANTED: [&str; 12] = [
    "SBATCH_WAIT",
    "SBATCH_WAIT_ALL_NODES",
    "SBATCH_ARRAY_INX",
    "SBATCH_INPUT",
    "SBATCH_OUTPUT",
    "SBATCH_ERROR",
    "SBATCH_OPEN_MODE",
    "SBATCH_NO_KILL",
    "SBATCH_GET_USER_ENV",
    "SBATCH_SIGNAL",
    "SBATCH_REQUEUE",
    "SBATCH_NO_REQUEUE",
];

/// Environment variables with defaults of `sbatch` from the user or the site: they apply unless a key of the section
/// overrides them.
pub fn site_defaults() -> Vec<String> {
    let names = std::env::vars_os().filter_map(|(name, _)| name.into_string().ok());
    let site = |name: &String| name.starts_with("SBATCH_") && !UNWANTED.contains(&name.as_str());
    let mut names: Vec<String> = names.filter(site).collect();
    names.sort();
    names
}

/// The real thing.
#[derive(Clone, Copy, Debug, Default)]
pub struct System;

impl Shell for System {
    fn call(&self, words: &[String], patience: Duration) -> Result<Answer, SlurmError> {
        let mut command = Command::new(&words[0]);
        command.args(&words[1..]);
        UNWANTED.iter().for_each(|name| {
            command.env_remove(name);
        });
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let program = || words[0].clone();
        let spawned = command.spawn();
        let mut child =
            spawned.map_err(|error| SlurmError::NotThere { program: program(), error })?;
        let (stdout, stderr) = (drain(child.stdout.take()), drain(child.stderr.take()));
        let Some(ok) = wait(&mut child, patience)? else {
            return Err(SlurmError::Silent { program: program(), seconds: patience.as_secs() });
        };
        tracing::info!(call = %words.join(" "), ok, "answered");
        let [stdout, stderr] = [stdout, stderr].map(|thread| thread.join().unwrap_or_default());
        Ok(Answer { ok, stdout, stderr })
    }
}

/// Reads a pipe to its end, so that a talkative program does not wait for us.
fn drain(pipe: Option<impl Read + Send + 'static>) -> std::thread::JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            let _ = pipe.read_to_end(&mut bytes);
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// Whether a child succeeded; `None` if it was killed since its time was up.
fn wait(child: &mut Child, patience: Duration) -> io::Result<Option<bool>> {
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status.success()));
        }
        if started.elapsed() > patience {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

// Errors of Slurm calls.

/// Why a command of Slurm gave no answer, or not the one that was wanted.
#[derive(Debug, thiserror::Error)]
pub enum SlurmError {
    #[error("`{program}` could not be started ({error}); is this a machine with Slurm on it?")]
    NotThere { program: String, error: io::Error },
    #[error("`{program}` gave no answer within {seconds} s")]
    Silent { program: String, seconds: u64 },
    #[error("`{program}` said: {said}")]
    Refused { program: String, said: String },
    #[error("`sbatch` answered `{0}`, in which there is no job's number")]
    NoNumber(String),
    #[error("files of the submission: {0}")]
    Files(#[from] FileError),
    #[error("files of the submission: {0}")]
    Io(#[from] io::Error),
}

// Slurm's messages of refusals that need no user. All refusals have the same exit code, so the message must be read;
// only this code reads it.

/// Too many jobs of this user are in the queue.
const SUBMIT_LIMIT: [&str; 4] = [
    "AssocMaxSubmitJobLimit",
    "QOSMaxSubmitJobPerUserLimit",
    "MaxSubmitJobs",
    "Job violates accounting/QOS policy",
];

/// The controller is busy, restarting or out of reach.
const BUSY: [&str; 6] = [
    "Unable to contact slurm controller",
    "Socket timed out",
    "temporarily unable",
    "Resource temporarily unavailable",
    "Connection refused",
    "Zero Bytes were transmitted",
];

impl SlurmError {
    fn says_any(&self, words: &[&str]) -> bool {
        matches!(self, Self::Refused { said, .. } if words.iter().any(|word| said.contains(word)))
    }

    /// Whether Slurm holds back because too many jobs of this user are in its queue.
    pub fn is_submit_limit(&self) -> bool {
        self.says_any(&SUBMIT_LIMIT)
    }

    /// Whether the same call may do in a moment.
    pub fn may_pass(&self) -> bool {
        matches!(self, Self::Silent { .. }) || self.says_any(&BUSY) && !self.is_submit_limit()
    }
}

// [`Settings`]: the section, as the sweep and the profile give it, with every default filled in.

/// MaxArraySize of a Slurm that says nothing else.
const MAX_ARRAY: usize = 1001;

/// A request to Slurm, with its settings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Settings(pub SlurmSection);

impl Settings {
    /// The same with `n` GPUs for each task of the runs, and as many runs at a time; unchanged if the section requests GPUs
    /// itself.
    pub fn with_gpus(mut self, n: usize) -> Self {
        let asked = self.resources(Stage::Train);
        if asked.gpus.is_none() && asked.gres.is_none() && asked.gpus_per_task.is_none() {
            let stages = self.0.stages.get_or_insert_default();
            let train = stages.entry(Stage::Train).or_default();
            train.gres = Some(Word(format!("gpu:{n}")));
            train.runs_at_once = asked.runs_at_once.or(Some(Count(n)));
        }
        self
    }

    /// The request of a stage's tasks.
    pub fn resources(&self, stage: Stage) -> Resources {
        let of_stage = self.0.stages.as_ref().and_then(|stages| stages.get(&stage)).cloned();
        of_stage.unwrap_or_default().over(self.0.resources())
    }

    /// The words that call one of Slurm's programs, `sbatch`, `squeue`, `scancel` or `scontrol`, with these arguments.
    pub fn program(&self, name: &str, arguments: &[&str]) -> Vec<String> {
        let given = match name {
            "sbatch" => &self.0.sbatch,
            "squeue" => &self.0.squeue,
            "scancel" => &self.0.scancel,
            _ => &self.0.scontrol,
        };
        let split = given.as_deref().and_then(shlex::split);
        let mut words = split.unwrap_or_else(|| vec![name.to_string()]);
        words.extend(self.0.clusters.iter().map(|name| format!("--clusters={name}")));
        words.extend(arguments.iter().map(ToString::to_string));
        words
    }

    /// Jobs of a chunk side by side.
    pub fn slots(&self, stage: Stage) -> usize {
        let Resources { runs_at_once, cpus_per_task, .. } = self.resources(stage);
        runs_at_once.or(cpus_per_task).map_or(1, |count| count.0)
    }

    /// The time limit of a stage's tasks in seconds, if set.
    pub fn limit_s(&self, stage: Stage) -> Option<f64> {
        let time = self.resources(stage).time?;
        Some(60.0 * minutes(&time.0)?)
    }

    /// Seconds of work that a task should have: half of the time limit at most.
    pub fn target_s(&self) -> f64 {
        let Amount(target) = self.0.target_chunk_minutes.unwrap_or(Amount(30.0));
        let half = self.limit_s(Stage::Train).map_or(f64::INFINITY, |limit| limit / 2.0);
        (60.0 * target).min(half)
    }

    /// Tasks of an array that run at once at most.
    pub fn array_parallel(&self) -> Option<usize> {
        self.0.array_parallel.map(|count| count.0)
    }

    /// Most tasks of an array, by the section or by Slurm.
    pub fn max_array(&self, asked: Option<usize>) -> usize {
        self.0.max_array.map(|count| count.0).or(asked).unwrap_or(MAX_ARRAY).max(1)
    }

    /// Tasks of a submission at most.
    pub fn max_submit(&self) -> usize {
        self.0.max_submit.map_or(usize::MAX, |count| count.0)
    }

    /// Seconds before the time limit at which a task of a stage is warned: a quarter of a short one.
    pub fn signal_grace_s(&self, stage: Stage) -> usize {
        let quarter = self.limit_s(stage).map_or(120, |limit| (limit / 4.0) as usize);
        self.0.signal_grace_s.map_or(120.min(quarter), |count| count.0)
    }

    /// Whether Slurm may put a task back into the queue.
    pub fn requeue(&self) -> bool {
        self.0.requeue.unwrap_or(true)
    }

    /// Times that a task puts itself back when its time is over.
    pub fn max_requeues(&self) -> usize {
        if self.requeue() { self.0.max_requeues.map_or(20, |count| count.0) } else { 0 }
    }

    /// Time that `isoflop cancel` waits for checkpoints.
    pub fn cancel_grace(&self) -> Duration {
        seconds(self.0.cancel_grace_s, 60.0)
    }

    /// Time that a task waits for files of another machine.
    pub fn fs_grace(&self) -> Duration {
        seconds(self.0.fs_grace_s, 90.0)
    }

    /// Whether laws are fitted although runs are missing.
    pub fn allow_missing(&self) -> bool {
        self.0.allow_missing.unwrap_or(false)
    }

    /// `--export`.
    pub fn export(&self) -> &str {
        self.0.export.as_deref().unwrap_or("ALL")
    }
}

fn seconds(amount: Option<Amount>, default: f64) -> Duration {
    Duration::from_secs_f64(amount.map_or(default, |amount| amount.0.max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sh(script: &str, patience: Duration) -> Result<String, SlurmError> {
        System.ask(&["sh", "-c", script].map(String::from), patience)
    }

    #[test]
    fn an_answer_a_refusal_and_silence_are_told_apart() {
        assert_eq!(sh("echo 7", QUERY).unwrap(), "7\n");
        let refused = sh("echo no such account >&2; exit 1", QUERY).unwrap_err();
        assert_eq!(refused.to_string(), "`sh` said: no such account");
        let silent = sh("exec sleep 60", Duration::from_millis(50)).unwrap_err();
        assert!(silent.may_pass(), "{silent}");
        let absent = System.ask(&["/no/such/sbatch".to_string()], QUERY).unwrap_err();
        assert!(absent.to_string().contains("is this a machine with Slurm"), "{absent}");
    }

    fn settings(text: &str) -> Settings {
        Settings(serde_yaml::from_str(text).unwrap())
    }

    #[test]
    fn a_stage_has_its_own_word_before_that_of_the_whole() {
        let text = "{time: 60, mem: 4G, stages: {fit: {mem: 16G}}, sbatch: 'ssh login sbatch'}";
        let settings = settings(text);
        let mem = |stage| settings.resources(stage).mem.unwrap().0;
        assert_eq!((mem(Stage::Fit).as_str(), mem(Stage::Train).as_str()), ("16G", "4G"));
        assert_eq!(settings.resources(Stage::Fit).time.unwrap().0, "60");
        assert_eq!(settings.program("sbatch", &[]), ["ssh", "login", "sbatch"]);
    }

    #[test]
    fn with_a_card_runs_ask_for_one_gpu_unless_the_section_says() {
        let asked = |text: &str, stage| {
            let resources = settings(text).with_gpus(1).resources(stage);
            let word = |word: Option<Word>| word.map(|word| word.0);
            (word(resources.gres), word(resources.gpus), resources.runs_at_once.map(|n| n.0))
        };
        let one = |at_once| (Some("gpu:1".to_string()), None, Some(at_once));
        assert_eq!(asked("{cpus_per_task: 8}", Stage::Train), one(1));
        assert_eq!(asked("{stages: {train: {runs_at_once: 4}}}", Stage::Train), one(4));
        let four = settings("{}").with_gpus(4).resources(Stage::Train);
        assert_eq!((four.gres.unwrap().0.as_str(), four.runs_at_once.unwrap().0), ("gpu:4", 4));
        assert_eq!(asked("{cpus_per_task: 8}", Stage::Inputs), (None, None, None));
        let own = (None, Some("0".to_string()), None);
        assert_eq!(asked("{gpus: 0}", Stage::Train), own, "none is asked for");
        let own = (Some("gpu:h100:1".to_string()), None, None);
        assert_eq!(asked("{stages: {train: {gres: 'gpu:h100:1'}}}", Stage::Train), own);
    }

    #[test]
    fn a_chunk_has_half_of_the_time_limit_at_most() {
        assert_eq!(settings("{}").target_s(), 1800.0);
        assert_eq!(settings("{time: 20}").target_s(), 600.0);
        assert_eq!(settings("{time: 20, target_chunk_minutes: 1}").target_s(), 60.0);
        assert_eq!(settings("{time: 1}").signal_grace_s(Stage::Train), 15);
        assert_eq!(settings("{}").signal_grace_s(Stage::Train), 120);
    }
}
