//! [`ResultsFolder`]: the files of a sweep, and the state of each job.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::job::{JobId, JobKind};
use super::run_scores::RunScores;
use crate::codes::TokenizerMetrics;
use crate::failure::{Failure, FailureKind};
use crate::files::{FileError, read_if_there};
use crate::laws::Validated;
use crate::plan::ScoreJob;
use crate::record::RunRecord;
use crate::sweep::{self, Sweep, SweepErrors};

/// The checkpoint of a job, in its folder.
pub const CHECKPOINT: &str = "checkpoint";

/// The state of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// It has a record.
    Done,
    /// It failed, and is retried only on request.
    Failed,
    /// It has a checkpoint to resume from.
    Started,
    /// Nothing is there.
    Missing,
}

/// The states of all runs of a folder at one time.
#[derive(Clone, Debug, Default)]
pub struct RunStates(HashMap<String, JobState>);

impl RunStates {
    /// The state of a run.
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

    /// The sweep's name, from the folder.
    pub fn name(&self) -> String {
        let full = fs::canonicalize(&self.root).unwrap_or_else(|_| self.root.clone());
        full.file_name().map_or_else(|| "sweep".into(), |name| name.to_string_lossy().into_owned())
    }

    /// The sweep as it was resolved when its runs were planned.
    ///
    /// # Errors
    /// The file is missing or damaged.
    pub fn sweep(&self) -> Result<Sweep, SweepErrors> {
        sweep::read_resolved(&self.file("sweep.yaml"))
    }

    /// `name` in the folder: `laws.json`, `runs.parquet`, `figures`.
    pub fn file(&self, name: impl AsRef<Path>) -> PathBuf {
        self.root.join(name)
    }

    /// The folder of a generator's laws, in a sweep with several generators.
    pub fn generators(&self) -> PathBuf {
        self.file("generators")
    }

    /// The laws, figures and predictions of one of several generators.
    pub fn of_generator(&self, name: &str) -> Self {
        Self::new(self.generators().join(name))
    }

    /// The folder of a job: `runs/<id>`, `tokenizers/<id>/tokens`.
    pub fn job(&self, JobId { kind, id }: &JobId) -> PathBuf {
        self.file(kind.folder(id))
    }

    /// The file that a job writes when all else is there.
    pub fn product(&self, job: &JobId) -> PathBuf {
        self.job(job).join(job.kind.product())
    }

    /// The state that a job goes on from.
    pub fn checkpoint(&self, job: &JobId) -> PathBuf {
        self.job(job).join(CHECKPOINT).join("state.safetensors")
    }

    /// The specification file of a job.
    pub fn spec(&self, JobId { kind, id }: &JobId) -> PathBuf {
        self.file(kind.spec(id))
    }

    /// The specification of a job; `None` if it is missing.
    ///
    /// # Errors
    /// The spec is damaged.
    pub fn read_spec<T: DeserializeOwned>(&self, job: &JobId) -> Result<Option<T>, FileError> {
        read_if_there(&self.spec(job))
    }

    /// The same; `None` if it is missing or damaged.
    pub fn known_spec<T: DeserializeOwned>(&self, job: &JobId) -> Option<T> {
        self.read_spec(job).ok().flatten()
    }

    /// The state of a job.
    pub fn state(&self, job: &JobId) -> JobState {
        let folder = self.job(job);
        if self.product(job).exists() {
            JobState::Done
        } else if folder.join("failure.json").exists() {
            JobState::Failed
        } else if folder.join(CHECKPOINT).exists() {
            JobState::Started
        } else {
            JobState::Missing
        }
    }

    /// The folder of a run.
    pub fn run(&self, run_id: &str) -> PathBuf {
        self.job(&JobId::run(run_id))
    }

    /// The folder of a tokenizer.
    pub fn tokenizer(&self, tokenizer_id: &str) -> PathBuf {
        self.job(&JobId::new(JobKind::Tokenizer, tokenizer_id))
    }

    /// The codes of a data set.
    pub fn tokens(&self, tokenizer_id: &str) -> PathBuf {
        self.product(&JobId::new(JobKind::Tokens, tokenizer_id))
    }

    /// The embedded captions of a data set.
    pub fn text(&self, text_id: &str) -> PathBuf {
        self.product(&JobId::new(JobKind::Text, text_id))
    }

    /// The states of runs with a folder, by id; other runs are missing. Lists the folder once, and looks into existing
    /// ones.
    pub fn run_states(&self) -> RunStates {
        let listed = fs::read_dir(self.root.join("runs")).into_iter().flatten().flatten();
        let name = |entry: fs::DirEntry| entry.file_name().to_str().map(str::to_string);
        let known = |id: String| (self.state(&JobId::run(id.as_str())), id);
        RunStates(listed.filter_map(name).map(known).map(|(state, id)| (id, state)).collect())
    }

    /// The record of a finished run; `None` if it has none.
    pub fn record(&self, run_id: &str) -> Result<Option<RunRecord>, FileError> {
        self.own_product(&JobId::run(run_id))
    }

    /// The failure of a job that ended with one. One that is damaged is a failure all the same.
    ///
    /// # Errors
    /// The file is there and cannot be read.
    pub fn failure(&self, job: &JobId) -> Result<Option<Failure>, FileError> {
        match read_if_there(&self.job(job).join("failure.json")) {
            Err(error @ FileError::Damaged { .. }) => {
                Ok(Some(Failure::new(FailureKind::Damaged, error.to_string())))
            }
            read => read,
        }
    }

    /// The metrics of a finished tokenizer.
    pub fn metrics(&self, tokenizer_id: &str) -> Result<Option<TokenizerMetrics>, FileError> {
        self.own_product(&JobId::new(JobKind::Tokenizer, tokenizer_id))
    }

    /// The folder of an evaluator.
    pub fn evaluator(&self, evaluator_id: &str) -> PathBuf {
        self.job(&JobId::new(JobKind::Evaluator, evaluator_id))
    }

    /// The scores of a run's motions.
    pub fn scores(&self, score_id: &str) -> Result<Option<RunScores>, FileError> {
        self.own_product(&JobId::new(JobKind::Score, score_id))
    }

    /// Metrics of every finished tokenizer in the folder, by vocabulary; damaged files are left out, with a call of
    /// `warn`.
    ///
    /// # Errors
    /// The folder cannot be listed.
    pub fn all_metrics(&self, warn: impl FnMut(String)) -> io::Result<Vec<TokenizerMetrics>> {
        let key = |m: &TokenizerMetrics| (m.n_vocab, m.tokenizer_id.clone());
        self.products(JobKind::Tokenizer, key, warn)
    }

    /// All scores that lie here, as [`ResultsFolder::all_metrics`].
    ///
    /// # Errors
    /// The folder cannot be listed.
    pub fn all_scores(&self, warn: impl FnMut(String)) -> io::Result<Vec<RunScores>> {
        self.products(JobKind::Score, |scores: &RunScores| scores.run_id.clone(), warn)
    }

    /// The folder of each validation.
    pub fn validation_folders(&self) -> impl Iterator<Item = PathBuf> {
        let entries = fs::read_dir(self.file("validations")).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).filter(|path| path.is_dir())
    }

    /// Every finished validation, by budget; damaged files are left out, with a call of `warn`.
    pub fn validations(&self, mut warn: impl FnMut(String)) -> Vec<Validated> {
        let mut all: Vec<Validated> = Vec::new();
        for path in self.validation_folders().map(|path| path.join("validation.json")) {
            match read_if_there::<Validated>(&path) {
                Ok(found) => all.extend(found),
                Err(error) => warn(error.to_string()),
            }
        }
        all.sort_by(|a, b| a.budget_flops.total_cmp(&b.budget_flops));
        all
    }

    /// What a finished job has made, if it is its own: a copy of another's is damaged.
    pub(super) fn own_product<T: Product>(&self, job: &JobId) -> Result<Option<T>, FileError> {
        let path = self.product(job);
        match read_if_there::<T>(&path)? {
            Some(product) if !product.is_of(job, self) => {
                Err(FileError::damaged(&path, "it is a copy of another job's"))
            }
            product => Ok(product),
        }
    }

    /// The products of all finished jobs of a kind, by a key; each that is damaged is left out.
    pub(super) fn products<T: Product, K: Ord>(
        &self,
        kind: JobKind,
        key: impl FnMut(&T) -> K,
        mut warn: impl FnMut(String),
    ) -> io::Result<Vec<T>> {
        let folder = self.file(kind.folder(""));
        if !folder.exists() {
            return Ok(Vec::new());
        }
        let mut products: Vec<T> = Vec::new();
        for entry in fs::read_dir(folder)? {
            match self.own_product(&JobId::new(kind, entry?.file_name().to_string_lossy())) {
                Ok(found) => products.extend(found),
                Err(error) => warn(error.to_string()),
            }
        }
        products.sort_by_key(key);
        Ok(products)
    }
}

/// What the last file of a job holds.
pub(super) trait Product: DeserializeOwned {
    /// Whether it says that this job made it.
    fn is_of(&self, job: &JobId, folder: &ResultsFolder) -> bool;
}

impl Product for RunRecord {
    fn is_of(&self, job: &JobId, _: &ResultsFolder) -> bool {
        self.planned.run_id == job.id
    }
}

impl Product for TokenizerMetrics {
    fn is_of(&self, job: &JobId, _: &ResultsFolder) -> bool {
        self.tokenizer_id == job.id
    }
}

impl Product for RunScores {
    /// Scores name their run alone.
    fn is_of(&self, job: &JobId, folder: &ResultsFolder) -> bool {
        let spec = folder.known_spec::<ScoreJob>(job);
        spec.is_none_or(|spec| spec.run_id == self.run_id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::atomic::write_json;

    #[test]
    fn a_copy_of_another_runs_record_is_damaged() {
        let place = tempfile::tempdir().unwrap();
        let folder = ResultsFolder::new(place.path());
        let record = include_str!("../../tests/fixtures/record-format-1.json");
        let record: RunRecord = serde_json::from_str(record).unwrap();
        let own = record.planned.run_id.as_str();
        for id in [own, "another"] {
            write_json(&folder.run(id).join("record.json"), &record).unwrap();
        }
        assert_eq!(folder.record(own).unwrap().as_ref(), Some(&record));
        let error = folder.record("another").unwrap_err();
        assert!(error.is_damage(), "{error}");
        let told = error.to_string();
        assert!(told.contains("a copy of another job's") && told.contains("trains the run again"));
        let mut warnings = Vec::new();
        let key = |record: &RunRecord| record.planned.run_id.clone();
        let all = folder.products(JobKind::Run, key, |line| warnings.push(line)).unwrap();
        assert_eq!((all, warnings.len()), (vec![record], 1));
    }
}
