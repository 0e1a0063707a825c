//! [`Shell`]: who calls the programs of Slurm. [`System`] does; tests have their own.

use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::engine::slurm::error::SlurmError;

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
    /// Also [`SlurmError::Refused`], with what the program said.
    fn ask(&self, words: &[String], patience: Duration) -> Result<String, SlurmError> {
        let answer = self.call(words, patience)?;
        if answer.ok {
            return Ok(answer.stdout);
        }
        let said = answer.stderr.lines().map(str::trim).collect::<Vec<_>>().join("; ");
        Err(SlurmError::refused(&words[0], said))
    }
}

/// How long a query may take.
pub const QUERY: Duration = Duration::from_secs(60);

/// Variables of the environment that would undo what we ask for: `sbatch` would wait for the job,
/// write elsewhere, or see two contradicting wishes.
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

/// Variables of the environment by which this user or this site set defaults of `sbatch`: they hold
/// where no key of the section says otherwise.
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
        let started = command.spawn();
        let mut child =
            started.map_err(|error| SlurmError::NotThere { program: words[0].clone(), error })?;
        let (stdout, stderr) = (drain(child.stdout.take()), drain(child.stderr.take()));
        let Some(ok) = wait(&mut child, patience)? else {
            let seconds = patience.as_secs();
            return Err(SlurmError::Silent { program: words[0].clone(), seconds });
        };
        let text = |thread: std::thread::JoinHandle<String>| thread.join().unwrap_or_default();
        tracing::info!(call = %words.join(" "), ok, "answered");
        Ok(Answer { ok, stdout: text(stdout), stderr: text(stderr) })
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

/// Whether a child succeeded; `None` where it was killed since its time was up.
fn wait(child: &mut Child, patience: Duration) -> std::io::Result<Option<bool>> {
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
}
