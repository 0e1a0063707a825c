//! [`Submission`]: everything that is about to be given to Slurm, before anything is.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::engine::Track;
use crate::engine::slurm::files::{Generation, SlurmFolder};
use crate::engine::slurm::script;
use crate::engine::slurm::script::{INDEX, SbatchCall, in_pattern};
use crate::engine::slurm::settings::Settings;
use crate::engine::slurm::stages::{After, Array};
use crate::jobs::ResultsFolder;
use crate::sweep::{SlurmSection, Stage};

/// What tasks read of their submission: `submit.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SubmissionTerms {
    /// The section, with the profile laid over it.
    pub settings: SlurmSection,
    /// As `--device` takes it.
    pub device: String,
    /// Digest of the program.
    pub program: String,
    /// By which runs were packed.
    pub flops_per_second: f64,
    /// As `--track` takes it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub track: Option<Track>,
}

/// The jobs of one call of `isoflop run --engine slurm`.
pub struct Submission {
    pub settings: Settings,
    /// Named by its full path.
    pub folder: ResultsFolder,
    pub generation: Generation,
    /// Where the command was given: paths of the sweep are relative to it.
    pub directory: PathBuf,
    pub written: SubmissionTerms,
    pub arrays: Vec<Array>,
    /// Numbers of jobs in the queue that the fit waits for too.
    pub queued: Vec<String>,
}

/// One call of `sbatch`.
pub struct SbatchStep {
    /// That of the array, or `fit`.
    pub name: String,
    pub stage: Stage,
    /// `None` for a job that is no array.
    pub tasks: Option<usize>,
    pub script: String,
}

impl Submission {
    /// The calls, in their order: every array, then the fit.
    pub fn steps(&self) -> Vec<SbatchStep> {
        let arrays = self.arrays.iter().map(|array| SbatchStep {
            name: array.name.clone(),
            stage: array.stage,
            tasks: Some(array.chunks.len()),
            script: self.script(array.stage, &["--stage", &array.name, "--chunk", INDEX]),
        });
        let fit = SbatchStep {
            name: Stage::Fit.word().to_string(),
            stage: Stage::Fit,
            tasks: None,
            script: self.script(Stage::Fit, &["--fit"]),
        };
        arrays.chain([fit]).collect()
    }

    fn script(&self, stage: Stage, what: &[&str]) -> String {
        let generation = self.generation.to_string();
        let program = self.files().program(&self.written.program).display().to_string();
        let results = self.folder.root().display().to_string();
        let words =
            [&program, "worker", &results, "--engine", "slurm", "--generation", &generation];
        let words: Vec<String> = words.iter().chain(what).map(ToString::to_string).collect();
        script::script(&self.settings.resources(stage), &self.directory, &words)
    }

    /// The words that submit a step, once the jobs of those before it have their numbers.
    pub fn words(&self, at: usize, step: &SbatchStep, token: &str, ids: &[String]) -> Vec<String> {
        let files = self.files();
        let patterns = if step.tasks.is_some() { "%A_%a" } else { "%A" };
        let log = format!(
            "{}/{}-{}-{patterns}.log",
            in_pattern(&files.logs()),
            self.generation,
            step.name
        );
        script::sbatch(&SbatchCall {
            settings: &self.settings,
            stage: step.stage,
            name: format!("{}-{}", self.folder.name(), step.name),
            token,
            tasks: step.tasks,
            dependency: self.dependency(at, ids),
            directory: &self.directory,
            log,
            script: &files.script(self.generation, &step.name),
        })
    }

    /// What a step waits for: an array for the success of certain tasks, the fit for the end of all.
    fn dependency(&self, at: usize, ids: &[String]) -> Option<String> {
        let Some(array) = self.arrays.get(at) else {
            let all: Vec<&str> = ids.iter().chain(&self.queued).map(String::as_str).collect();
            return (!all.is_empty()).then(|| format!("afterany:{}", all.join(":")));
        };
        let task = |after: &After| match after {
            After::Ours { array, index } => format!("{}_{index}", ids[*array]),
            After::Queued(task) => task.clone(),
        };
        let tasks: Vec<String> = array.after.iter().map(task).collect();
        (!tasks.is_empty()).then(|| format!("afterok:{}", tasks.join(":")))
    }

    /// The folder of what is written for Slurm.
    pub fn files(&self) -> SlurmFolder {
        SlurmFolder::of(&self.folder)
    }

    /// A sentence on a path that Slurm could not be given; `None` where all is well.
    pub fn unspeakable(&self) -> Option<String> {
        let bad = |path: &Path| path.display().to_string().contains(['\\', '\n']);
        let paths = [self.folder.root(), &self.directory];
        let found = paths.into_iter().find(|path| bad(path))?;
        Some(format!(
            "{} has a backslash or a new line in its name, which Slurm's log files cannot have",
            found.display()
        ))
    }
}
