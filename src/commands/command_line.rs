//! [`CommandLine`]: the `isoflop run` that made a folder, kept there so that it can be said again.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use isoflop::engine::ENGINES;
use isoflop::files::{atomic, read_if_there};
use isoflop::jobs::{JobId, ResultsFolder};
use isoflop::units::quoted;
use serde::{Deserialize, Serialize};

use super::run::RunArgs;

/// Width of a terminal that shows a command whole.
const WIDTH: usize = 80;

/// A command and the directory that it was given in.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CommandLine {
    directory: PathBuf,
    words: Vec<String>,
}

impl CommandLine {
    /// The command as it was given, without what says how to treat failures.
    pub fn of(args: &RunArgs) -> Result<Self> {
        let sweep = &args.sweep;
        let mut words = vec!["isoflop".to_string()];
        words.extend(args.said_as.iter().take(1).cloned());
        words.push(sweep.sweep.display().to_string());
        words.extend(args.said_as.iter().skip(1).cloned());
        for setting in &sweep.settings {
            words.extend(["--set".to_string(), setting.clone()]);
        }
        words.extend(["--out".to_string(), sweep.out.display().to_string()]);
        words.extend(sweep.jobs.iter().flat_map(|n| ["--jobs".to_string(), n.to_string()]));
        words.extend(["--device".to_string(), sweep.device.name().to_string()]);
        words.extend(args.memory.iter().flat_map(|n| ["--memory".to_string(), n.to_string()]));
        words.extend(args.track.iter().flat_map(|t| ["--track".to_string(), t.name().to_string()]));
        if args.engine.name() != ENGINES[0].name() {
            words.extend(["--engine".to_string(), args.engine.name().to_string()]);
        }
        words.extend(args.rounds.iter().flat_map(|n| ["--rounds".to_string(), n.to_string()]));
        words.extend(args.until.iter().flat_map(|n| ["--until".to_string(), n.to_string()]));
        let profile = args.profile.iter();
        words.extend(profile.flat_map(|path| ["--profile".into(), path.display().to_string()]));
        let directory = std::env::current_dir().context("finding the current directory")?;
        Ok(Self { directory, words })
    }

    /// Keeps it in the folder of the sweep that it runs.
    pub fn write(&self, folder: &ResultsFolder) -> Result<()> {
        Ok(atomic::write_json(&folder.file("command.json"), self)?)
    }

    /// The command that a folder came from; the resolved sweep in it, where none was kept whole.
    pub fn read(folder: &ResultsFolder) -> Result<Self> {
        if let Ok(Some(kept)) = read_if_there(&folder.file("command.json")) {
            return Ok(kept);
        }
        let out = folder.root().parent().filter(|parent| !parent.as_os_str().is_empty());
        let out = out.unwrap_or(Path::new("."));
        let words = ["isoflop", "run", &folder.file("sweep.yaml").display().to_string(), "--out"];
        let mut words: Vec<String> = words.into_iter().map(String::from).collect();
        words.push(out.display().to_string());
        let directory = std::env::current_dir().context("finding the current directory")?;
        Ok(Self { directory, words })
    }

    /// What goes on from where the sweep stands, as a shell reads it from the same directory.
    pub fn go_on(&self) -> String {
        self.groups(&[]).join(" ")
    }

    /// What tries again what failed, as a shell reads it from the same directory.
    pub fn retry(&self) -> String {
        self.groups(&["--retry-failed"]).join(" ")
    }

    /// [`CommandLine::go_on`] from wherever one stands.
    pub fn go_on_from(&self, here: &Path) -> String {
        self.change_to(here) + &self.go_on()
    }

    /// What tries one job again, and what it needs.
    pub fn retry_one(&self, job: &JobId) -> String {
        self.groups(&["--retry", &job.id]).join(" ")
    }

    /// [`CommandLine::retry`] from wherever one stands.
    pub fn retry_from(&self, here: &Path) -> String {
        self.change_to(here) + &self.retry()
    }

    /// [`CommandLine::retry_one`] from wherever one stands.
    pub fn retry_one_from(&self, here: &Path, job: &JobId) -> String {
        self.change_to(here) + &self.retry_one(job)
    }

    /// A command over as many lines as it needs, which a shell still reads as one.
    pub fn broken(command: &str) -> String {
        Self::broken_after("  ", command)
    }

    /// [`CommandLine::broken`] with something before it on its first line.
    pub fn broken_after(head: &str, command: &str) -> String {
        let mut out = String::new();
        let mut width = head.chars().count();
        for (place, word) in split_quoted(command).into_iter().enumerate() {
            let length = word.chars().count();
            if place > 0 && width + 1 + length > WIDTH - 2 {
                out += " \\\n      ";
                width = 6;
            } else if place > 0 {
                out.push(' ');
                width += 1;
            }
            out += word;
            width += length;
        }
        format!("{head}{out}")
    }

    fn change_to(&self, here: &Path) -> String {
        if here == self.directory {
            return String::new();
        }
        format!("cd {} && ", quoted(&self.directory.display().to_string()))
    }

    fn groups(&self, more: &[&str]) -> Vec<String> {
        let words = self.words.iter().map(String::as_str).chain(more.iter().copied());
        words.map(quoted).collect()
    }
}

/// The words of a command; spaces between quotes part nothing.
fn split_quoted(command: &str) -> Vec<&str> {
    let mut inside = false;
    let parts = command.split(move |c: char| {
        inside ^= c == '\'';
        c == ' ' && !inside
    });
    parts.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_change_them() {
        assert_eq!(quoted("train.lr.max=1e-3"), "train.lr.max=1e-3");
        assert_eq!(quoted("grid.budgets=[1e9, 2e9]"), "'grid.budgets=[1e9, 2e9]'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }

    #[test]
    fn a_long_command_is_broken_between_words_alone() {
        let long = format!("isoflop run a.yaml --set '{}' --jobs 2", "b c ".repeat(20));
        let broken = CommandLine::broken(&long);
        assert_eq!(broken.lines().count(), 3, "{broken}");
        assert_eq!(broken.trim_start().replace(" \\\n      ", " "), long);
    }
}
