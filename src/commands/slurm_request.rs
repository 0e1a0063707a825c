//! What `isoflop run --engine slurm` asks of Slurm, cut into arrays.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use isoflop::record::{JobId, ResultsFolder};
use isoflop::schedule::{Job, all_jobs};
use isoflop::slurm::{
    self, Array, Estimates, Layout, Settings, Shell, SlurmFolder, Submission, Submitted, Written,
    site_defaults,
};

use super::args::RunArgs;
use super::context::{OpenSweep, device};
use super::output::Output;

/// FLOPs a second that a GPU is taken to give, where no run has ended on it yet.
const GPU: f64 = 1e12;

/// What is to be submitted, before it is cut into arrays.
pub struct Request<'a> {
    pub args: &'a RunArgs,
    pub open: &'a OpenSweep,
    pub settings: Settings,
    pub jobs: Vec<Job>,
    /// Jobs that are in the queue already, and their tasks.
    pub queued: HashMap<JobId, String>,
    /// Numbers of the jobs that are in the queue already.
    pub active: Vec<String>,
    /// MaxArraySize, as Slurm says.
    pub asked: Option<usize>,
}

impl Request<'_> {
    /// Submits; in fewer and longer tasks, where Slurm takes no more.
    pub fn submit(&self, shell: &dyn Shell, output: &Output) -> Result<(u32, Vec<Submitted>)> {
        for name in site_defaults() {
            output.note(&format!("{name} is set here, and holds where the sweep does not say"));
        }
        let program = std::env::current_exe().context("finding this program")?;
        let digest = digest(&program)?;
        let files = SlurmFolder::of(&self.open.folder);
        slurm::keep_program(&program, &files.program(&digest)).context("copying this program")?;
        let estimates = self.estimates(output)?;
        let user = user(&self.open.folder)?;
        let mut most = self.settings.max_submit();
        loop {
            let submission = self.submission(digest.clone(), &estimates, most)?;
            let tasks = tasks(&submission.arrays);
            match slurm::submit(&submission, user, shell) {
                Ok(submitted) => return Ok((submission.generation, submitted)),
                Err(error) if error.is_submit_limit() && tasks > 2 => {
                    most = tasks / 2;
                    let fewer = self.submission(digest.clone(), &estimates, most)?;
                    if tasks == self::tasks(&fewer.arrays) {
                        return Err(error).context("Slurm takes no more jobs of this user");
                    }
                    output.note(&format!("{error}; trying again in {most} longer tasks at most"));
                }
                Err(error) => return Err(error).context("nothing of this submission stays"),
            }
        }
    }

    /// What would be submitted now, by a program that is not copied yet.
    pub fn preview(&self, output: &Output) -> Result<Submission> {
        let estimates = self.estimates(output)?;
        self.submission("PROGRAM".to_string(), &estimates, self.settings.max_submit())
    }

    fn submission(
        &self,
        program: String,
        estimates: &Estimates,
        max_tasks: usize,
    ) -> Result<Submission> {
        let OpenSweep { plan, folder, .. } = self.open;
        let reads: HashMap<JobId, Vec<JobId>> =
            all_jobs(plan).map(|job| (job.id, job.needs)).collect();
        let layout = Layout {
            settings: &self.settings,
            estimates,
            reads: &|id| reads.get(id).cloned().unwrap_or_default(),
            queued: &self.queued,
            max_array: self.settings.max_array(self.asked),
            max_tasks,
        };
        let arrays = slurm::arrays(&self.jobs, &layout);
        let submission = Submission {
            settings: self.settings.clone(),
            folder: folder.clone(),
            generation: SlurmFolder::of(folder).latest()?.unwrap_or(0) + 1,
            directory: std::env::current_dir().context("finding the current directory")?,
            written: Written {
                settings: self.settings.section().clone(),
                device: self.args.sweep.device.name().to_string(),
                program,
                flops_per_second: estimates.flops_per_second,
            },
            arrays,
            queued: self.active.clone(),
        };
        match submission.unspeakable() {
            Some(problem) => bail!(problem),
            None => Ok(submission),
        }
    }

    /// How fast jobs are: as the section says, as runs were, or as a few steps here show.
    fn estimates(&self, output: &Output) -> Result<Estimates> {
        let OpenSweep { plan, folder, .. } = self.open;
        let given = self.settings.section().flops_per_second;
        let estimates = match (given, Estimates::of_records(plan, folder)?) {
            (Some(rate), _) => Estimates::given(rate.0),
            (None, Some(measured)) => measured,
            (None, None) => match self.args.sweep.device {
                name if name.is_processor() => Estimates::of_probe(plan, &device(name)?),
                _ => Estimates { flops_per_second: GPU, source: "guessed" },
            },
        };
        let Estimates { flops_per_second, source } = &estimates;
        output.note(&format!("runs are packed by {flops_per_second:.2e} FLOPs a second, {source}"));
        Ok(estimates)
    }
}

fn tasks(arrays: &[Array]) -> usize {
    arrays.iter().map(|array| array.chunks.len()).sum()
}

fn digest(program: &Path) -> Result<String> {
    let bytes = fs::read(program).with_context(|| format!("reading {}", program.display()))?;
    Ok(blake3::hash(&bytes).to_hex()[..16].to_string())
}

/// Who writes to the folder, by number: whose jobs these will be.
fn user(folder: &ResultsFolder) -> Result<u32> {
    use std::os::unix::fs::MetadataExt;
    Ok(fs::metadata(folder.file("plan.json"))?.uid())
}
