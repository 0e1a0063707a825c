//! [`Submission`]: everything to submit to Slurm, prepared in advance, and Slurm's answer to a test.

use super::command::{Answer, QUERY, Settings, Shell, SlurmError, System};
use super::files::{Generation, SlurmFolder};
use super::stages::{After, Array};
use crate::engine::Track;
use crate::jobs::ResultsFolder;
use crate::sweep::{Resources, Stage, Word, minutes};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The file of a submission that tasks read: `submit.json`.
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
    /// The working directory of the command: paths of the sweep are relative to it.
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
        let mut words =
            vec![&program, "worker", &results, "--engine", "slurm", "--generation", &generation];
        match step.tasks() {
            Some(_) => words.extend(["--stage", &step.name, "--chunk", INDEX]),
            None => words.push("--fit"),
        }
        script(&self.written.settings.resources(step.stage), &self.directory, &words)
    }

    /// The command that submits a step, given the job numbers of earlier steps. All options are here, none in the script,
    /// so the printed command is complete; no option of a site is passed unless the section names it.
    pub fn words(&self, step: &Array, token: &str, ids: &[String]) -> Vec<String> {
        let Self { written, folder, generation, directory, .. } = self;
        let (settings, name) = (&written.settings, &step.name);
        let resources = settings.resources(step.stage);
        let patterns = if step.tasks().is_some() { "%A_%a" } else { "%A" };
        let logs = in_pattern(&self.files().logs());
        let mut words = settings.program("sbatch", &[]);
        words.extend([
            "--parsable".to_string(),
            format!("--job-name={}-{name}", folder.name()),
            format!("--comment={token}"),
            format!("--chdir={}", directory.display()),
            format!("--output={logs}/{generation}-{name}-{patterns}.log"),
            "--open-mode=append".to_string(),
            if settings.requeue() { "--requeue" } else { "--no-requeue" }.to_string(),
            // Without it, a job that waits for a failed one would wait forever.
            "--kill-on-invalid-dep=yes".to_string(),
            "--nodes=1".to_string(),
            "--ntasks=1".to_string(),
            format!("--export={}", settings.export()),
        ]);
        // Without the B, the signal would reach steps alone, of which there are none. The fit has nothing
        // to checkpoint.
        let grace = settings.signal_grace_s(step.stage);
        let warned = step.stage != Stage::Fit;
        words.extend(warned.then(|| format!("--signal=B:USR2@{grace}")));
        words.extend(step.tasks().map(|tasks| array(tasks, settings.array_parallel())));
        words.extend(self.dependency(step, ids).map(|text| format!("--dependency={text}")));
        words.extend(asked_for(&resources));
        words.extend(resources.extra.into_iter().flatten());
        words.push(self.files().script(*generation, name).display().to_string());
        words
    }

    /// The dependencies of a step: an array waits for the success of certain tasks, the fit for the end of all.
    fn dependency(&self, step: &Array, ids: &[String]) -> Option<String> {
        let task = |after: &After| match after {
            After::Ours { array, index } => format!("{}_{index}", ids[*array]),
            After::Queued(task) => task.clone(),
        };
        let (how, jobs): (&str, Vec<String>) = match step.stage {
            Stage::Fit => ("afterany", ids.iter().chain(&self.queued).cloned().collect()),
            _ => ("afterok", step.after.iter().map(task).collect()),
        };
        (!jobs.is_empty()).then(|| format!("{how}:{}", jobs.join(":")))
    }

    /// Tasks of all arrays.
    pub fn tasks(&self) -> usize {
        self.steps.iter().map(|array| array.chunks.len()).sum()
    }

    /// The folder of what is written for Slurm.
    pub fn files(&self) -> SlurmFolder {
        SlurmFolder::of(&self.folder)
    }

    /// A sentence on a path that Slurm could not be given; `None` if all is well.
    pub fn unspeakable(&self) -> Option<String> {
        let bad = |path: &Path| path.display().to_string().contains(['\\', '\n']);
        let paths = [self.folder.root(), &self.directory];
        let found = paths.into_iter().find(|path| bad(path))?;
        let sentence =
            "has a backslash or a new line in its name, which Slurm's log files cannot have";
        Some(format!("{} {sentence}", found.display()))
    }
}

// What Slurm is given: the batch script, and what `sbatch` is asked for.

/// The tasks of an array, and how many of them run at once.
pub fn array(tasks: usize, parallel: Option<usize>) -> String {
    let limit = parallel.map(|parallel| format!("%{parallel}")).unwrap_or_default();
    format!("--array=0-{}{limit}", tasks.saturating_sub(1))
}

/// Only the keys of the section.
pub fn asked_for(resources: &Resources) -> Vec<String> {
    let text = |text: &Option<String>| text.clone();
    let word = |word: &Option<Word>| word.as_ref().map(|word| word.0.clone());
    let gpus = |gpus: &Option<Word>| word(gpus).filter(|gpus| gpus != "0");
    let cpus = resources.cpus_per_task.map_or(1, |count| count.0);
    let options = [
        ("partition", text(&resources.partition)),
        ("account", text(&resources.account)),
        ("qos", text(&resources.qos)),
        ("reservation", text(&resources.reservation)),
        ("constraint", text(&resources.constraint)),
        ("exclude", text(&resources.exclude)),
        ("nodelist", text(&resources.nodelist)),
        ("time", word(&resources.time)),
        ("cpus-per-task", Some(cpus.to_string())),
        ("mem", word(&resources.mem)),
        ("mem-per-cpu", word(&resources.mem_per_cpu)),
        ("mem-per-gpu", word(&resources.mem_per_gpu)),
        ("gpus", gpus(&resources.gpus)),
        ("gres", word(&resources.gres)),
        ("gpus-per-task", gpus(&resources.gpus_per_task)),
        ("nice", word(&resources.nice)),
    ];
    let given = options.into_iter().filter_map(|(name, value)| Some((name, value?)));
    given.map(|(name, value)| format!("--{name}={value}")).collect()
}

/// The batch script: variables, the preamble, then the program in place of the shell. As a child of
/// the shell it would get no warning, or outlive the job.
pub fn script(resources: &Resources, directory: &Path, program: &[&str]) -> String {
    let mut text = "#!/bin/bash\nset -e\n".to_string();
    for (name, value) in resources.env.iter().flatten() {
        text += &format!("export {name}={}\n", quoted(&value.0));
    }
    for line in resources.preamble.iter().flatten() {
        text += &format!("{line}\n");
    }
    // A node without this directory would run the job in its temporary folder.
    text += &format!("cd -- {}\n", quoted(&directory.display().to_string()));
    let launcher = resources.launcher.iter().flatten().map(String::as_str);
    let words: Vec<String> = launcher.chain(program.iter().copied()).map(quoted).collect();
    text + &format!("exec {}\n", words.join(" "))
}

/// The one word that the shell of the task is to fill in.
pub const INDEX: &str = "\"$SLURM_ARRAY_TASK_ID\"";

/// A word as a shell reads it.
pub fn quoted(word: &str) -> String {
    if word == INDEX {
        return word.to_string();
    }
    shlex::try_quote(word).map_or_else(|_| format!("{word:?}"), |quoted| quoted.into_owned())
}

/// A path as a part of a pattern for log files: Slurm takes `%` for its own.
pub fn in_pattern(path: &Path) -> String {
    path.display().to_string().replace('%', "%%")
}

// What Slurm would say to it.

/// Slurm's word on one step.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Verdict {
    pub name: String,
    /// Whether it would be taken, and would begin some day.
    pub taken: bool,
    /// Place and time of the start, or the refusal, in Slurm's words.
    pub said: String,
}

impl Submission {
    /// Asks Slurm of every step whether it would take it (`sbatch --test-only`), and whether its time
    /// limit is one of the partition's: many a Slurm takes a longer one, and then lets it wait for ever.
    ///
    /// # Errors
    /// Slurm gave no answer, or a script could not be written for it to read.
    pub fn verdicts(&self) -> Result<Vec<Verdict>, SlurmError> {
        self.steps.iter().enumerate().map(|(at, step)| self.verdict(at, step)).collect()
    }

    fn verdict(&self, at: usize, step: &Array) -> Result<Verdict, SlurmError> {
        // Where the command was given, which the machine that submits must see anyhow.
        let mut script =
            tempfile::Builder::new().prefix(".isoflop-check-").tempfile_in(&self.directory)?;
        script.write_all(self.script(step).as_bytes())?;
        // Dependencies are left out: they have no number.
        let mut words = self.words(step, "check", &vec!["0".to_string(); at]);
        words.retain(|word| !word.starts_with("--dependency="));
        let options = self.written.settings.program("sbatch", &[]).len();
        words.insert(options, "--test-only".to_string());
        words.pop();
        words.push(script.path().display().to_string());
        let answer = System.call(&words, QUERY)?;
        let (name, said) = (step.name.clone(), last_line(&answer));
        if answer.ok {
            let too_long = self.too_long(step, &said)?;
            let taken = too_long.is_none();
            return Ok(Verdict { name, taken, said: too_long.unwrap_or_else(|| begin(&said)) });
        }
        let refused = SlurmError::Refused { program: words.swap_remove(0), said: said.clone() };
        if refused.may_pass() { Err(refused) } else { Ok(Verdict { name, taken: false, said }) }
    }

    /// A warning if the time limit exceeds the one of the chosen partition.
    fn too_long(&self, step: &Array, said: &str) -> Result<Option<String>, SlurmError> {
        let settings = &self.written.settings;
        let partition = between(said, " in partition ", " ");
        let Some((partition, asked)) = partition.zip(settings.resources(step.stage).time) else {
            return Ok(None);
        };
        let words = ["show", "partition", partition, "--oneliner"];
        let shown = System.ask(&settings.program("scontrol", &words), QUERY)?;
        let most = shown.split_whitespace().find_map(|word| word.strip_prefix("MaxTime="));
        let beyond = most.filter(|most| {
            minutes(&asked.0).zip(minutes(most)).is_some_and(|(asked, most)| asked > most)
        });
        Ok(beyond.map(|most| {
            format!("time {} is beyond partition {partition}'s {most}: waits for ever", asked.0)
        }))
    }
}

/// The last thing that was said, without the name of the program.
fn last_line(answer: &Answer) -> String {
    let lines = || answer.stderr.lines().chain(answer.stdout.lines()).map(str::trim);
    let last = lines().rfind(|line| !line.is_empty()).unwrap_or("nothing");
    let last = last.strip_prefix("sbatch: ").unwrap_or(last);
    last.strip_prefix("error: ").unwrap_or(last).to_string()
}

/// `Job 9 to start at TIME using 1 processors on nodes NODES in partition PARTITION`, without the parts that are
/// meaningless in a test.
fn begin(said: &str) -> String {
    let parts = [" to start at ", " on nodes ", " in partition "];
    match parts.map(|before| between(said, before, " ")) {
        [Some(time), Some(nodes), Some(partition)] => {
            format!("from {time} on {nodes} in partition {partition}")
        }
        _ => said.to_string(),
    }
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    text.split_once(before)?.1.split(after).next()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resources(text: &str) -> Resources {
        serde_yaml::from_str(text).unwrap()
    }

    #[test]
    fn nothing_is_asked_for_that_the_section_does_not_name() {
        assert_eq!(asked_for(&Resources::default()), ["--cpus-per-task=1"]);
        let asked = resources("{partition: cpu, time: 90, mem: 4G, gpus: 0, cpus_per_task: 8}");
        let expected = ["--partition=cpu", "--time=90", "--cpus-per-task=8", "--mem=4G"];
        assert_eq!(asked_for(&asked), expected);
    }

    #[test]
    fn the_program_takes_the_place_of_the_shell_and_odd_words_stay_whole() {
        let text = "{env: {A: it's}, preamble: [module load x], launcher: [apptainer, exec, a b]}";
        let program = ["/p q/isoflop", "worker", "--chunk", INDEX];
        let script = script(&resources(text), Path::new("/my dir"), &program);
        let expected = "#!/bin/bash\nset -e\nexport A=\"it's\"\nmodule load x\ncd -- '/my dir'\n\
                        exec apptainer exec 'a b' '/p q/isoflop' worker --chunk \
                        \"$SLURM_ARRAY_TASK_ID\"\n";
        assert_eq!(script, expected);
    }

    #[test]
    fn an_array_counts_from_zero() {
        assert_eq!(array(1, None), "--array=0-0");
        assert_eq!(array(20, Some(4)), "--array=0-19%4");
        assert_eq!(in_pattern(Path::new("/a%A/b")), "/a%%A/b");
    }

    #[test]
    fn where_a_job_would_begin_is_said_in_short_and_anything_else_as_it_is() {
        let said = "Job 9 to start at 2026-11-21T17:01:49 using 1 processors on nodes n[1-2] in \
                    partition main";
        assert_eq!(begin(said), "from 2026-11-21T17:01:49 on n[1-2] in partition main");
        assert_eq!(begin("a job could begin"), "a job could begin");
    }
}
