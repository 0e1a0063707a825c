//! The command line of `isoflop run`: its arguments ([`RunArgs`]), and its copy in the sweep's folder, to be shown
//! again ([`CommandLine`]).

use crate::commands::args::share;
use crate::commands::context::{SweepArgs, a_track, an_engine};
use crate::commands::prelude::*;
use isoflop::engine::{ENGINES, Engine, Preview, Track};
use isoflop::units::{parse_bytes, quoted};

/// Width at which commands are broken into lines.
const WIDTH: usize = 80;

#[derive(Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub sweep: SweepArgs,
    /// Where jobs run
    #[arg(long, value_parser = an_engine(), default_value = ENGINES[0].name())]
    pub engine: &'static dyn Engine,
    #[command(flatten)]
    pub options: RunOptions,
    /// The command shown to the user, and its own options
    #[arg(skip = vec!["run".to_string()])]
    pub said_as: Vec<String>,
}

/// How a sweep is run.
#[derive(Args, Default)]
pub struct RunOptions {
    /// A file of engine settings, which override the sweep's `engine` section
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// Print what would be submitted; submit and change nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Ask the engine whether it would take the sweep; submit and change nothing
    #[arg(long, conflicts_with = "dry_run")]
    pub check: bool,
    /// Stop at the first failure
    #[arg(long)]
    pub fail_fast: bool,
    /// Retry failed jobs
    #[arg(long)]
    pub retry_failed: bool,
    /// Retry the job with this id (the name of its folder) and its dependencies; may be repeated
    #[arg(long, value_name = "ID")]
    pub retry: Vec<String>,
    /// Train the grid in at most K parts, each chosen to narrow the prediction most per FLOP
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..))]
    pub rounds: Option<u16>,
    /// End the rounds once half the 95 % interval of L_u at the largest of predict.budgets is at most
    /// this fraction of L_u, e.g. 0.02
    #[arg(long, value_name = "WIDTH", requires = "rounds", value_parser = share)]
    pub until: Option<f64>,
    /// Memory for all jobs together, e.g. 8GB; by default all memory free at the start
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes)]
    pub memory: Option<u64>,
    /// Follow training in an experiment tracker
    #[arg(long, value_parser = a_track(), value_name = "TRACKER")]
    pub track: Option<Track>,
}

impl RunArgs {
    /// Runs all missing jobs of a sweep on an engine.
    pub fn of(sweep: SweepArgs, engine: &'static dyn Engine) -> Self {
        Self { sweep, engine, options: RunOptions::default(), said_as: vec!["run".to_string()] }
    }

    /// Refuses options that the engine does not support.
    ///
    /// # Errors
    /// A sentence that names the engines that support the option.
    pub fn check_engine(&self) -> Result<()> {
        let asked = [
            ("--dry-run", self.options.dry_run),
            ("--check", self.options.check),
            ("--profile", self.options.profile.is_some()),
        ];
        let mut asked = asked.into_iter().filter(|_| !self.engine.hands_over());
        let Some((option, _)) = asked.find(|(_, is_asked)| *is_asked) else { return Ok(()) };
        let others = ENGINES.into_iter().filter(|engine| engine.hands_over());
        let others: Vec<String> =
            others.map(|engine| format!("--engine {}", engine.name())).collect();
        bail!(
            "{option} wants {}; `isoflop plan` shows what this machine would do",
            others.join(" or ")
        )
    }

    /// Refuses a tracker that the trainer does not support.
    ///
    /// # Errors
    /// A sentence that names the trainer that does.
    pub fn check_track(&self, sweep: &Sweep) -> Result<()> {
        match self.options.track {
            Some(track @ (Track::Wandb | Track::Mlflow)) if sweep.trainer.is_none() => bail!(
                "--track {} wants `trainer: torch`; the built-in trainer is followed by --track tensorboard",
                track.name()
            ),
            _ => Ok(()),
        }
    }

    /// Output that changes nothing.
    pub fn preview(&self) -> Option<Preview> {
        let dry_run = self.options.dry_run.then_some(Preview::DryRun);
        dry_run.or_else(|| self.options.check.then_some(Preview::Check))
    }
}

/// A command and its working directory.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CommandLine {
    directory: PathBuf,
    words: Vec<String>,
}

impl CommandLine {
    /// The command as typed, without options about failures.
    pub fn of(args: &RunArgs) -> Result<Self> {
        let SweepArgs { sweep, settings, out, work } = &args.sweep;
        let [command, own @ ..] = &args.said_as[..] else { bail!("a command has a name") };
        let mut words = vec!["isoflop".to_string(), command.clone(), sweep.display().to_string()];
        words.extend(own.iter().cloned());
        let settings = settings.iter().map(|setting| ("--set", Some(setting.clone())));
        let engine = Some(args.engine.name()).filter(|name| *name != ENGINES[0].name());
        let options = [
            ("--out", Some(out.display().to_string())),
            ("--jobs", work.jobs.map(|n| n.to_string())),
            ("--device", Some(work.device.name().to_string())),
            ("--memory", args.options.memory.map(|n| n.to_string())),
            ("--track", args.options.track.map(|track| track.name().to_string())),
            ("--engine", engine.map(String::from)),
            ("--rounds", args.options.rounds.map(|n| n.to_string())),
            ("--until", args.options.until.map(|share| share.to_string())),
            ("--profile", args.options.profile.as_ref().map(|path| path.display().to_string())),
        ];
        for (option, value) in settings.chain(options) {
            words.extend(value.into_iter().flat_map(|value| [option.to_string(), value]));
        }
        let directory = std::env::current_dir().context("finding the current directory")?;
        Ok(Self { directory, words })
    }

    /// Writes it to the folder of its sweep.
    pub fn write(&self, folder: &ResultsFolder) -> Result<()> {
        Ok(atomic::write_json(&folder.file("command.json"), self)?)
    }

    /// The command that made a folder; if it was not kept, a run of the folder's resolved sweep.
    pub fn read(folder: &ResultsFolder) -> Result<Self> {
        if let Ok(Some(kept)) = read_if_there(&folder.file("command.json")) {
            return Ok(kept);
        }
        let out = folder.root().parent().filter(|parent| !parent.as_os_str().is_empty());
        let [sweep, out] = [&*folder.file("sweep.yaml"), out.unwrap_or(Path::new("."))]
            .map(|path| path.display().to_string());
        let words = ["isoflop", "run", &sweep, "--out", &out].map(String::from).to_vec();
        let directory = std::env::current_dir().context("finding the current directory")?;
        Ok(Self { directory, words })
    }

    /// The command with further options, quoted for a shell, to be run in the same directory or from `here`.
    pub fn said(&self, here: Option<&Path>, more: &[&str]) -> String {
        let words = self.words.iter().map(String::as_str).chain(more.iter().copied());
        let command = words.map(quoted).collect::<Vec<_>>().join(" ");
        match here.filter(|here| *here != self.directory) {
            Some(_) => format!("cd {} && {command}", quoted(&self.directory.display().to_string())),
            None => command,
        }
    }

    /// A command broken into lines that a shell joins, after a head on its first line.
    pub fn broken(head: &str, command: &str) -> String {
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
}

/// The words of a command; spaces within quotes do not split.
fn split_quoted(command: &str) -> Vec<&str> {
    let mut inside = false;
    let parts_here = |c: char| {
        inside ^= c == '\'';
        c == ' ' && !inside
    };
    command.split(parts_here).collect()
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
        let broken = CommandLine::broken("  ", &long);
        assert_eq!(broken.lines().count(), 3, "{broken}");
        assert_eq!(broken.trim_start().replace(" \\\n      ", " "), long);
    }
}
