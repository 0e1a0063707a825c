//! [`Submission`]: everything that is about to be given to Slurm, before anything is.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::engine::Track;
use crate::engine::slurm::files::{Generation, SlurmFolder};
use crate::engine::slurm::script;
use crate::engine::slurm::script::{INDEX, array, asked_for, in_pattern};
use crate::engine::slurm::settings::Settings;
use crate::engine::slurm::stages::{After, Array};
use crate::jobs::ResultsFolder;
use crate::sweep::Stage;

/// What tasks read of their submission: `submit.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SubmissionTerms {
    /// The section, with the profile laid over it.
    pub settings: Settings,
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
    /// Named by its full path.
    pub folder: ResultsFolder,
    pub generation: Generation,
    /// Where the command was given: paths of the sweep are relative to it.
    pub directory: PathBuf,
    pub written: SubmissionTerms,
    /// The calls of `sbatch`, in their order: every array, then the fit.
    pub steps: Vec<Array>,
    /// Numbers of jobs in the queue that the fit waits for too.
    pub queued: Vec<String>,
}

impl Submission {
    /// The batch script of a step.
    pub fn script(&self, step: &Array) -> String {
        let generation = self.generation.to_string();
        let program = self.files().program(&self.written.program).display().to_string();
        let results = self.folder.root().display().to_string();
        let words =
            [&program, "worker", &results, "--engine", "slurm", "--generation", &generation];
        let of_array = ["--stage", &step.name, "--chunk", INDEX];
        let what: &[&str] = if step.tasks().is_some() { &of_array[..] } else { &["--fit"] };
        let words: Vec<String> = words.iter().chain(what).map(ToString::to_string).collect();
        script::script(&self.written.settings.resources(step.stage), &self.directory, &words)
    }

    /// The words that submit a step, once the jobs of those before it have their numbers. Nothing stands in the
    /// script, so that what is printed is all that there is; nothing of a site's is given that the section does not
    /// name.
    pub fn words(&self, step: &Array, token: &str, ids: &[String]) -> Vec<String> {
        let settings = &self.written.settings;
        let resources = settings.resources(step.stage);
        let mut words = settings.program("sbatch", &[]);
        words.extend(self.fixed(step, token));
        // Without the B, the signal would reach steps alone, of which there are none. The fit has nothing
        // to checkpoint.
        let grace = settings.signal_grace_s(step.stage);
        let warned = step.stage != Stage::Fit;
        words.extend(warned.then(|| format!("--signal=B:USR2@{grace}")));
        words.extend(step.tasks().map(|tasks| array(tasks, settings.array_parallel())));
        words.extend(self.dependency(step, ids).map(|text| format!("--dependency={text}")));
        words.extend(asked_for(&resources));
        words.extend(resources.extra.into_iter().flatten());
        words.push(self.files().script(self.generation, &step.name).display().to_string());
        words
    }

    fn fixed(&self, step: &Array, token: &str) -> [String; 11] {
        let Self { written, folder, generation, directory, .. } = self;
        let (settings, name) = (&written.settings, &step.name);
        let patterns = if step.tasks().is_some() { "%A_%a" } else { "%A" };
        let logs = in_pattern(&self.files().logs());
        [
            "--parsable".to_string(),
            format!("--job-name={}-{name}", folder.name()),
            format!("--comment={token}"),
            format!("--chdir={}", directory.display()),
            format!("--output={logs}/{generation}-{name}-{patterns}.log"),
            "--open-mode=append".to_string(),
            if settings.requeue() { "--requeue" } else { "--no-requeue" }.to_string(),
            // Without it, what waits for something that failed would wait for ever.
            "--kill-on-invalid-dep=yes".to_string(),
            "--nodes=1".to_string(),
            "--ntasks=1".to_string(),
            format!("--export={}", settings.export()),
        ]
    }

    /// What a step waits for: an array for the success of certain tasks, the fit for the end of all.
    fn dependency(&self, step: &Array, ids: &[String]) -> Option<String> {
        if step.stage == Stage::Fit {
            let all: Vec<&str> = ids.iter().chain(&self.queued).map(String::as_str).collect();
            return (!all.is_empty()).then(|| format!("afterany:{}", all.join(":")));
        }
        let task = |after: &After| match after {
            After::Ours { array, index } => format!("{}_{index}", ids[*array]),
            After::Queued(task) => task.clone(),
        };
        let tasks: Vec<String> = step.after.iter().map(task).collect();
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
