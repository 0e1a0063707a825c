//! What Slurm would say to a submission, without one.

use std::io::{self, Write};

use super::command::{Answer, QUERY, Shell, SlurmError};

use crate::engine::slurm::stages::Array;
use crate::engine::slurm::submission::Submission;
use crate::sweep::minutes;

/// Slurm's word on one step.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Verdict {
    pub name: String,
    /// Whether it would be taken, and would begin some day.
    pub taken: bool,
    /// Where and when it would begin, or why not, as Slurm says it.
    pub said: String,
}

/// Asks Slurm of every step whether it would take it (`sbatch --test-only`), and whether its time
/// limit is one of the partition's: many a Slurm takes a longer one, and then lets it wait for ever.
///
/// # Errors
/// Slurm gave no answer, or a script could not be written for it to read.
pub fn check(submission: &Submission, shell: &dyn Shell) -> Result<Vec<Verdict>, SlurmError> {
    let verdict = |(at, step)| verdict(submission, at, step, shell);
    submission.steps.iter().enumerate().map(verdict).collect()
}

fn verdict(
    submission: &Submission,
    at: usize,
    step: &Array,
    shell: &dyn Shell,
) -> Result<Verdict, SlurmError> {
    // Where the command was given, which the machine that submits must see anyhow.
    let mut script =
        tempfile::Builder::new().prefix(".isoflop-check-").tempfile_in(&submission.directory)?;
    script.write_all(submission.script(step).as_bytes())?;
    let words = tried(submission, at, step, &script.path().display().to_string())?;
    let answer = shell.call(&words, QUERY)?;
    let said = last_line(&answer);
    let name = step.name.clone();
    if answer.ok {
        let too_long = too_long(submission, step, &said, shell)?;
        let taken = too_long.is_none();
        return Ok(Verdict { name, taken, said: too_long.unwrap_or_else(|| begin(&said)) });
    }
    let refused = SlurmError::refused(&words[0], said.clone());
    if refused.may_pass() { Err(refused) } else { Ok(Verdict { name, taken: false, said }) }
}

/// The words that submit a step, for trying only. What it waits for is left out: it has no number.
fn tried(
    submission: &Submission,
    at: usize,
    step: &Array,
    script: &str,
) -> io::Result<Vec<String>> {
    let numbers = vec!["0".to_string(); at];
    let mut words = submission.words(step, "check", &numbers);
    words.retain(|word| !word.starts_with("--dependency="));
    words.insert(
        submission.written.settings.program("sbatch", &[]).len(),
        "--test-only".to_string(),
    );
    words.pop();
    words.push(script.to_string());
    Ok(words)
}

/// The last thing that was said, without the name of the program.
fn last_line(answer: &Answer) -> String {
    let lines = || answer.stderr.lines().chain(answer.stdout.lines()).map(str::trim);
    let last = lines().rfind(|line| !line.is_empty()).unwrap_or("nothing");
    let last = last.strip_prefix("sbatch: ").unwrap_or(last);
    last.strip_prefix("error: ").unwrap_or(last).to_string()
}

/// `Job 9 to start at TIME using 1 processors on nodes NODES in partition PARTITION` without what says
/// nothing of a job that is not to be.
fn begin(said: &str) -> String {
    let parts = (
        between(said, " to start at ", " "),
        between(said, " on nodes ", " "),
        between(said, " in partition ", " "),
    );
    match parts {
        (Some(time), Some(nodes), Some(partition)) => {
            format!("from {time} on {nodes} in partition {partition}")
        }
        _ => said.to_string(),
    }
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    text.split_once(before)?.1.split(after).next()
}

/// A sentence on a time limit beyond that of the partition that Slurm chose.
fn too_long(
    submission: &Submission,
    step: &Array,
    said: &str,
    shell: &dyn Shell,
) -> Result<Option<String>, SlurmError> {
    let partition = between(said, " in partition ", " ");
    let asked = submission.written.settings.resources(step.stage).time;
    let (Some(partition), Some(asked)) = (partition, asked) else { return Ok(None) };
    let words = ["show", "partition", partition, "--oneliner"];
    let shown = shell.ask(&submission.written.settings.program("scontrol", &words), QUERY)?;
    let most = shown.split_whitespace().find_map(|word| word.strip_prefix("MaxTime="));
    let Some(most) = most else { return Ok(None) };
    let beyond = minutes(&asked.0).zip(minutes(most)).is_some_and(|(asked, most)| asked > most);
    let sentence =
        format!("time {} is beyond partition {partition}'s {most}: waits for ever", asked.0);
    Ok(beyond.then_some(sentence))
}

#[cfg(test)]
mod tests {
    use crate::engine::slurm::check::begin;

    #[test]
    fn where_a_job_would_begin_is_said_in_short_and_anything_else_as_it_is() {
        let said = "Job 9 to start at 2026-11-21T17:01:49 using 1 processors on nodes n[1-2] in \
                    partition main";
        assert_eq!(begin(said), "from 2026-11-21T17:01:49 on n[1-2] in partition main");
        assert_eq!(begin("a job could begin"), "a job could begin");
    }
}
