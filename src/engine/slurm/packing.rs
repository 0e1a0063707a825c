//! Missing jobs, cut into the arrays of a submission.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};

use super::cluster::Cluster;
use super::command::{Shell, site_defaults};
use super::estimate::Estimates;
use super::files::SlurmFolder;
use super::ledger::Entry;
use super::stages::{Array, Layout, arrays};
use super::submission::{Submission, SubmissionTerms};
use super::submit::{keep_program, submit};
use crate::jobs::gpu::Gpu;
use crate::jobs::{Job, JobId, ResultsFolder, all_jobs};

/// FLOPs a second that a GPU is taken to give, where no run has ended on it yet.
const GPU: f64 = 1e12;

/// What is to be submitted, before it is cut into arrays.
pub struct Packed<'a> {
    pub jobs: &'a [Job],
    /// Jobs that are in the queue already, and their tasks.
    pub queued: &'a HashMap<JobId, String>,
}

impl Cluster<'_> {
    /// Submits; in fewer and longer tasks, where Slurm takes no more.
    pub fn submit(&self, packed: &Packed, shell: &dyn Shell) -> Result<(u32, Vec<Entry>)> {
        let tell = self.request.tell;
        for name in site_defaults() {
            tell.note(&format!(
                "{name} is set in this shell and applies wherever the sweep is silent"
            ));
        }
        let program = std::env::current_exe().context("finding this program")?;
        let digest = digest(&program)?;
        let files = SlurmFolder::of(&self.folder);
        keep_program(&program, &files.program(&digest)).context("copying this program")?;
        let estimates = self.estimates()?;
        let user = user(&self.folder)?;
        let mut most = self.settings.max_submit();
        loop {
            let submission = self.submission(packed, digest.clone(), &estimates, most)?;
            let tasks = tasks(&submission.steps);
            match submit(&submission, user, shell) {
                Ok(submitted) => return Ok((submission.generation, submitted)),
                Err(error) if error.is_submit_limit() && tasks > 2 => {
                    most = tasks / 2;
                    let fewer = self.submission(packed, digest.clone(), &estimates, most)?;
                    if tasks == self::tasks(&fewer.steps) {
                        return Err(error).context("Slurm takes no more jobs of this user");
                    }
                    tell.note(&format!("{error}; trying again in {most} longer tasks at most"));
                }
                Err(error) => return Err(error).context("nothing of this submission stays"),
            }
        }
    }

    /// What would be submitted now, by a program that is not copied yet.
    pub fn packed(&self, packed: &Packed) -> Result<Submission> {
        let (estimates, most) = (self.estimates()?, self.settings.max_submit());
        self.submission(packed, "PROGRAM".to_string(), &estimates, most)
    }

    fn submission(
        &self,
        packed: &Packed,
        program: String,
        estimates: &Estimates,
        max_tasks: usize,
    ) -> Result<Submission> {
        let (plan, folder) = (self.request.plan, &self.folder);
        let reads: HashMap<JobId, Vec<JobId>> =
            all_jobs(plan).map(|job| (job.id, job.needs)).collect();
        let layout = Layout {
            settings: &self.settings,
            estimates,
            reads: &|id| reads.get(id).cloned().unwrap_or_default(),
            queued: packed.queued,
            max_array: self.settings.max_array(self.asked),
            max_tasks,
        };
        let mut steps = arrays(packed.jobs, &layout);
        steps.push(Array::fit());
        let submission = Submission {
            folder: folder.clone(),
            generation: SlurmFolder::of(folder).latest()?.unwrap_or(0) + 1,
            directory: std::env::current_dir().context("finding the current directory")?,
            written: SubmissionTerms {
                settings: self.settings.clone(),
                device: self.request.device.name().to_string(),
                program,
                flops_per_second: estimates.flops_per_second,
                track: self.request.track,
            },
            steps,
            queued: self.queue.active_jobs(),
        };
        match submission.unspeakable() {
            Some(problem) => bail!(problem),
            None => Ok(submission),
        }
    }

    /// How fast jobs are: as the section says, as runs were, as the card should be, or as a few steps here show.
    fn estimates(&self) -> Result<Estimates> {
        let (plan, folder) = (self.request.plan, &self.folder);
        let engine = self.request.sweep.engine.as_ref();
        let card = engine.and_then(|engine| Some((engine.card()?, engine.mfu.map(|mfu| mfu.0))));
        let given = self.settings.0.flops_per_second;
        let trainer = self.request.sweep.trainer.as_ref();
        let estimates = match (given, Estimates::of_records(plan, folder)?) {
            (Some(rate), _) => Estimates::given(rate.0),
            (None, Some(measured)) => measured,
            (None, None) if card.is_none() && trainer.is_some_and(|own| own.gpus.is_some()) => {
                Estimates { flops_per_second: GPU, source: UNTIMED }
            }
            (None, None) => match (card, self.request.device) {
                (Some((card, mfu)), _) => {
                    Estimates::of_card(plan, &Gpu::new(card, mfu, plan, folder))
                }
                (None, name) if name.is_processor() => {
                    let probe = Estimates::of_probe(plan, &name.open()?);
                    if trainer.is_some() { Estimates { source: UNTIMED, ..probe } } else { probe }
                }
                (None, _) => Estimates { flops_per_second: GPU, source: "guessed" },
            },
        };
        let Estimates { flops_per_second, source } = &estimates;
        self.request
            .tell
            .note(&format!("runs are packed by {flops_per_second:.2e} FLOPs a second, {source}"));
        Ok(estimates)
    }
}

/// The rate of a program that is not ours.
const UNTIMED: &str = "guessed, since your trainer has not been timed: flops_per_second says it";

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
