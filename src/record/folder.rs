//! [`ResultsFolder`]: where everything of a sweep lies, and what state each job is in.

use std::collections::HashMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::failure::{Failure, FailureKind, os_error};
use super::job_id::{JobId, JobKind};
use super::run_record::RunRecord;
use crate::tokenizer::TokenizerMetrics;

/// How far a job is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// Its record is there.
    Done,
    /// It ended with a failure, and is tried again only when asked for.
    Failed,
    /// It left a checkpoint to go on from.
    Started,
    /// Nothing is there.
    Missing,
}

/// How far the runs of a folder are, as seen at one time.
#[derive(Clone, Debug, Default)]
pub struct RunStates(HashMap<String, JobState>);

impl RunStates {
    /// How far a run is.
    pub fn of(&self, run_id: &str) -> JobState {
        self.0.get(run_id).copied().unwrap_or(JobState::Missing)
    }
}

/// The folder of one sweep: `results/<name>`.
#[derive(Clone, Debug)]
pub struct ResultsFolder {
    root: PathBuf,
}

impl ResultsFolder {
    /// The folder at `root`, which need not exist.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The sweep's name: that of the folder.
    pub fn name(&self) -> String {
        let full = fs::canonicalize(&self.root).unwrap_or_else(|_| self.root.clone());
        full.file_name().map_or_else(|| "sweep".into(), |name| name.to_string_lossy().into_owned())
    }

    /// `name` in the folder: `laws.json`, `runs.parquet`, `figures`.
    pub fn file(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// The folder of a job: `runs/<id>`, `trunks/<id>`, `tokenizers/<id>`, `tokenizers/<id>/tokens`,
    /// `text/<id>`.
    pub fn job(&self, JobId { kind, id }: &JobId) -> PathBuf {
        match kind {
            JobKind::Text => self.root.join("text").join(id),
            JobKind::Tokenizer => self.tokenizer(id),
            JobKind::Tokens => self.tokenizer(id).join("tokens"),
            JobKind::Trunk => self.root.join("trunks").join(id),
            JobKind::Run => self.run(id),
        }
    }

    /// The file that a job writes when all else is there.
    pub fn product(&self, job: &JobId) -> PathBuf {
        self.job(job).join(match job.kind {
            JobKind::Text => "vectors.safetensors",
            JobKind::Tokenizer => "metrics.json",
            JobKind::Tokens => "codes.safetensors",
            JobKind::Trunk => "state.safetensors",
            JobKind::Run => "record.json",
        })
    }

    /// How far a job is.
    pub fn state(&self, job: &JobId) -> JobState {
        let folder = self.job(job);
        if self.product(job).exists() {
            JobState::Done
        } else if folder.join("failure.json").exists() {
            JobState::Failed
        } else if folder.join("checkpoint").exists() {
            JobState::Started
        } else {
            JobState::Missing
        }
    }

    /// The folder of a run.
    pub fn run(&self, run_id: &str) -> PathBuf {
        self.root.join("runs").join(run_id)
    }

    /// The folder of a tokenizer.
    pub fn tokenizer(&self, tokenizer_id: &str) -> PathBuf {
        self.root.join("tokenizers").join(tokenizer_id)
    }

    /// The codes of a data set.
    pub fn tokens(&self, tokenizer_id: &str) -> PathBuf {
        self.product(&JobId::new(JobKind::Tokens, tokenizer_id))
    }

    /// The embedded captions of a data set.
    pub fn text(&self, text_id: &str) -> PathBuf {
        self.product(&JobId::new(JobKind::Text, text_id))
    }

    /// Where a trunk ends and runs branch off.
    pub fn trunk(&self, trunk_id: &str) -> PathBuf {
        self.product(&JobId::new(JobKind::Trunk, trunk_id))
    }

    /// How far each run is that has a folder, by id; the others are missing. One listing of the
    /// folder, and a look into those that are there.
    pub fn run_states(&self) -> RunStates {
        let listed = fs::read_dir(self.root.join("runs")).into_iter().flatten().flatten();
        let name = |entry: fs::DirEntry| entry.file_name().to_str().map(str::to_string);
        let known = |id: String| (self.state(&JobId::run(id.as_str())), id);
        RunStates(listed.filter_map(name).map(known).map(|(state, id)| (id, state)).collect())
    }

    /// The record of a finished run; `None` where it has none.
    pub fn record(&self, run_id: &str) -> io::Result<Option<RunRecord>> {
        read_if_there(&self.run(run_id).join("record.json"))
    }

    /// The failure of a job that ended with one. One that is damaged is a failure all the same.
    ///
    /// # Errors
    /// The file is there and cannot be read.
    pub fn failure(&self, job: &JobId) -> io::Result<Option<Failure>> {
        match read_if_there(&self.job(job).join("failure.json")) {
            Err(error) if os_error(&error.to_string()).is_none() => {
                Ok(Some(Failure::new(FailureKind::Damaged, error.to_string())))
            }
            read => read,
        }
    }

    /// The metrics of a finished tokenizer.
    pub fn metrics(&self, tokenizer_id: &str) -> io::Result<Option<TokenizerMetrics>> {
        read_if_there(&self.tokenizer(tokenizer_id).join("metrics.json"))
    }

    /// Metrics of every finished tokenizer that lies here, by vocabulary; `warn` is told of each
    /// file that is damaged, which is left out.
    ///
    /// # Errors
    /// The folder cannot be listed.
    pub fn all_metrics(&self, mut warn: impl FnMut(String)) -> io::Result<Vec<TokenizerMetrics>> {
        let folder = self.root.join("tokenizers");
        if !folder.exists() {
            return Ok(Vec::new());
        }
        let mut metrics: Vec<TokenizerMetrics> = Vec::new();
        for entry in fs::read_dir(folder)? {
            match read_if_there::<TokenizerMetrics>(&entry?.path().join("metrics.json")) {
                Ok(found) => metrics.extend(found),
                Err(error) => warn(error.to_string()),
            }
        }
        metrics.sort_by_key(|m| (m.n_vocab, m.tokenizer_id.clone()));
        Ok(metrics)
    }
}

/// Reads a JSON file; a missing one is `None`, a broken one an error that names it.
pub fn read_if_there<T: serde::de::DeserializeOwned>(path: &Path) -> io::Result<Option<T>> {
    match fs::read(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(io::Error::new(error.kind(), format!("{}: {error}", path.display()))),
        Ok(bytes) => serde_json::from_slice(&bytes).map(Some).map_err(|error| {
            let advice = mended_by(path);
            io::Error::other(format!("{} is damaged ({error}); {advice}", path.display()))
        }),
    }
}

/// How a damaged file is mended.
fn mended_by(path: &Path) -> &'static str {
    match path.file_name().and_then(|name| name.to_str()).unwrap_or_default() {
        "record.json" => "`isoflop run` sets it aside and trains the run again",
        "metrics.json" => "`isoflop run` sets it aside and trains the tokenizer again",
        "failure.json" => "`isoflop run` with --retry-failed tries the job again",
        "plan.json" | "spec.json" | "job.json" | "laws.json" => "`isoflop run` writes it again",
        _ => "remove it to have it made again",
    }
}
