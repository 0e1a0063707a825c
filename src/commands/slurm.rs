//! `isoflop run --engine slurm`: what is missing of a sweep, given to Slurm.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use isoflop::record::{JobId, JobKind, ResultsFolder};
use isoflop::schedule::{Job, all_jobs, missing_jobs};
use isoflop::slurm::{
    self, After, Array, Entry, Estimates, Layout, Ledger, QUERY, Queue, Settings, Shell,
    SlurmError, SlurmFolder, Submission, Submitted, System, Task, Written, site_defaults,
};
use isoflop::sweep::read_profile;
use serde_json::json;

use super::args::RunArgs;
use super::command_line::CommandLine;
use super::context::{OpenSweep, device};
use super::exit::Exit;
use super::failures::Summary;
use super::output::Output;
use super::prepare::prepare;
use super::{analyse, run};

/// FLOPs a second that a GPU is taken to give, where no run has ended on it yet.
const GPU: f64 = 1e12;

/// Submits what is missing and returns at once.
pub fn run(args: &RunArgs, output: &Output) -> Result<Exit> {
    let OpenSweep { sweep, plan, folder } = run::open(args, output)?;
    let folder = ResultsFolder::new(std::path::absolute(folder.root())?);
    let open = OpenSweep { sweep, plan, folder };
    let settings = settings(args, &open)?;
    if args.dry_run {
        return dry_run(args, &open, settings, output);
    }
    let shell = System;
    // Slurm must answer before anything is changed.
    let asked = max_array(&settings, &shell).context("nothing was submitted or changed")?;
    let held = run::hold(&open.folder, output)?;
    let (entries, queue) = queue(&open.folder, &settings, &shell)
        .context("what is in the queue is not known, so nothing was submitted or changed")?;
    prepare(&open, args, output)?;
    CommandLine::of(args)?.write(&open.folder)?;
    let files = SlurmFolder::of(&open.folder);
    let held_jobs = queue.held(&entries, &files)?;
    let jobs = missing_jobs(&open.plan, &open.folder);
    let left = jobs.iter().filter(|job| !held_jobs.contains_key(&job.id)).count();
    if left == 0 && has_fit(&entries, &queue) {
        return in_the_queue(&open, &queue, output);
    }
    if left == 0 && !queue.is_active() {
        drop(held);
        analyse::finish(&open.folder, output)?;
        let summary = Summary::new(args, &open.plan, &open.folder, &[])?;
        return Ok(summary.tell(output));
    }
    let active = queue.active_jobs();
    let request = Request { args, open: &open, settings, jobs, queued: held_jobs, active, asked };
    let (generation, submitted) = request.submit(&shell, output)?;
    report(&open, generation, &submitted, left, output)
}

/// The section of the sweep, under that of the profile.
fn settings(args: &RunArgs, open: &OpenSweep) -> Result<Settings> {
    let of_sweep = open.sweep.engine.clone().unwrap_or_default().slurm;
    let section = match &args.profile {
        Some(path) => read_profile(path)?.over(of_sweep),
        None => of_sweep,
    };
    Ok(Settings::new(section))
}

/// MaxArraySize; also shows whether the controller answers.
fn max_array(settings: &Settings, shell: &dyn Shell) -> Result<Option<usize>, SlurmError> {
    let mut words = settings.program("scontrol");
    words.extend(["show", "config"].map(String::from));
    let said = shell.ask(&words, QUERY)?;
    let line = said.lines().find(|line| line.starts_with("MaxArraySize"));
    Ok(line.and_then(|line| line.split('=').nth(1)?.trim().parse().ok()))
}

/// The ledger and what Slurm says of it. An entry without a number is of a submission that was cut
/// off: its job is looked for, and the entry settled.
fn queue(
    folder: &ResultsFolder,
    settings: &Settings,
    shell: &dyn Shell,
) -> Result<(Vec<Entry>, Queue)> {
    let ledger = Ledger::of(&SlurmFolder::of(folder));
    let entries = ledger.entries()?;
    let queue = Queue::ask(shell, settings, &entries)?;
    for entry in entries.iter().filter(|entry| entry.job_id.is_none()) {
        match queue.of(entry).next() {
            Some(task) => {
                let job_id = Some(task.job_id.clone());
                ledger.write(&Entry { job_id, ..entry.clone() })?;
            }
            None => ledger.take_back(entry)?,
        }
    }
    Ok((ledger.entries()?, queue))
}

/// Whether a fit is in the queue: a submission that was cut off may have got none.
fn has_fit(entries: &[Entry], queue: &Queue) -> bool {
    let fits = entries.iter().filter(|entry| entry.tasks.is_none());
    fits.flat_map(|entry| queue.of(entry)).any(Task::is_active)
}

fn in_the_queue(open: &OpenSweep, queue: &Queue, output: &Output) -> Result<Exit> {
    let active = queue.tasks.iter().filter(|task| task.is_active()).count();
    let document = json!({"submitted": [], "active_tasks": active, "results": open.folder.root()});
    let text = format!(
        "everything that is missing is in Slurm's queue already, in {active} tasks\n\
         how far it is: isoflop status {}",
        CommandLine::quoted(&open.folder.root().display().to_string())
    );
    output.result(&document, &text)?;
    Ok(Exit::Done)
}

/// What is to be submitted, before it is cut into arrays.
struct Request<'a> {
    args: &'a RunArgs,
    open: &'a OpenSweep,
    settings: Settings,
    jobs: Vec<Job>,
    queued: HashMap<JobId, String>,
    /// Numbers of the jobs that are in the queue already.
    active: Vec<String>,
    /// MaxArraySize, as Slurm says.
    asked: Option<usize>,
}

impl Request<'_> {
    /// Submits; in fewer and longer tasks, where Slurm takes no more.
    fn submit(&self, shell: &dyn Shell, output: &Output) -> Result<(u32, Vec<Submitted>)> {
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

fn report(
    open: &OpenSweep,
    generation: u32,
    submitted: &[Submitted],
    left: usize,
    output: &Output,
) -> Result<Exit> {
    let root = open.folder.root();
    let document = json!({"generation": generation, "submitted": submitted, "results": root});
    let tasks = |job: &Submitted| match job.tasks {
        Some(1) => "1 task".to_string(),
        Some(tasks) => format!("{tasks} tasks"),
        None => "after all others".to_string(),
    };
    let line =
        |job: &Submitted| format!("  {:<12} job {:<10} {}\n", job.name, job.job_id, tasks(job));
    let text = format!(
        "{}: {left} jobs submitted\n{}how far it is: isoflop status {}",
        open.sweep.name,
        submitted.iter().map(line).collect::<String>(),
        CommandLine::quoted(&root.display().to_string())
    );
    output.result(&document, &text)?;
    Ok(Exit::Done)
}

/// What would be submitted if the queue were empty: scripts, and the calls with what Slurm and chance
/// will say left open.
fn dry_run(args: &RunArgs, open: &OpenSweep, settings: Settings, output: &Output) -> Result<Exit> {
    let jobs = missing_jobs(&open.plan, &open.folder);
    if jobs.is_empty() {
        bail!("nothing is missing, so there is nothing to submit");
    }
    let left = jobs.len();
    let request = Request {
        args,
        open,
        settings,
        jobs,
        queued: HashMap::new(),
        active: Vec::new(),
        asked: None,
    };
    let estimates = request.estimates(output)?;
    let most = request.settings.max_submit();
    let submission = request.submission("PROGRAM".to_string(), &estimates, most)?;
    let steps = submission.steps();
    let ids: Vec<String> = steps.iter().map(|step| format!("ID_OF_{}", step.name)).collect();
    let (mut text, mut documents) = (String::new(), Vec::new());
    for (at, step) in steps.iter().enumerate() {
        let words = submission.words(at, step, "TOKEN", &ids[..at]);
        let path = submission.files().script(submission.generation, &step.name);
        let jobs = submission.arrays.get(at).map(counts);
        text += &format!("# {}{}\n", step.name, jobs.clone().unwrap_or_default());
        text += &format!("{}\n\n# {}\n{}\n", shown(&words), path.display(), step.script);
        documents.push(json!({"name": step.name, "sbatch": words, "script": step.script}));
    }
    let document = json!({"jobs": left, "submissions": documents});
    output.result(&document, &text)?;
    Ok(Exit::Done)
}

/// `: 2 tasks, 12 runs`.
fn counts(array: &Array) -> String {
    let jobs = || array.chunks.iter().flat_map(|chunk| &chunk.jobs);
    let of = |kind| jobs().filter(|timed| timed.job.id.kind == kind).count();
    let kinds = JobKind::ALL.map(|kind| (kind, of(kind)));
    let kinds = kinds.iter().filter(|(_, count)| *count > 0);
    let named: Vec<String> = kinds.map(|(kind, n)| format!("{n} × {}", kind.word())).collect();
    let waits = array.after.iter().any(|after| matches!(after, After::Queued(_)));
    let waits = if waits { ", after jobs in the queue" } else { "" };
    format!(": {} tasks, {}{waits}", array.chunks.len(), named.join(", "))
}

/// A call over several lines, as a shell reads it.
fn shown(words: &[String]) -> String {
    let words: Vec<String> = words.iter().map(|word| CommandLine::quoted(word)).collect();
    words.join(" \\\n  ")
}

/// The settings, the ledger and the queue of a folder that a command looks into; `None` where nothing
/// was ever submitted from it.
pub fn of_folder(folder: &ResultsFolder) -> Result<Option<(Settings, Vec<Entry>)>> {
    let folder = ResultsFolder::new(std::path::absolute(folder.root())?);
    let files = SlurmFolder::of(&folder);
    let Some(generation) = files.latest()? else { return Ok(None) };
    let path: PathBuf = files.written(generation);
    let written: Option<Written> = isoflop::record::read_if_there(&path)?;
    let settings = Settings::new(written.map(|written| written.settings).unwrap_or_default());
    Ok(Some((settings, Ledger::of(&files).entries()?)))
}
