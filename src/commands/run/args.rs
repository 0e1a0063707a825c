//! The command line of `isoflop run`, as it is typed.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use isoflop::engine::{ENGINES, Engine, Preview, Track};
use isoflop::sweep::Sweep;
use isoflop::units::parse_bytes;

use crate::commands::exit::{SweepArgs, a_track, an_engine, share};

#[derive(Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub sweep: SweepArgs,
    /// Where jobs run
    #[arg(long, value_parser = an_engine(), default_value = ENGINES[0].name())]
    pub engine: &'static dyn Engine,
    #[command(flatten)]
    pub options: RunOptions,
    /// The command in whose name it runs, and options that are that command's own
    #[arg(skip = vec!["run".to_string()])]
    pub said_as: Vec<String>,
}

/// How a sweep is run.
#[derive(Args, Default)]
pub struct RunOptions {
    /// A file with keys of the engine's section, which override those of the sweep
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
    /// Try again what failed before
    #[arg(long)]
    pub retry_failed: bool,
    /// Try this job again, with the jobs it needs, by the id of its folder; may be repeated
    #[arg(long, value_name = "ID")]
    pub retry: Vec<String>,
    /// Train the grid a part at a time, at most K parts, each chosen to sharpen the prediction most for
    /// its FLOPs
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..))]
    pub rounds: Option<u16>,
    /// End the rounds where half the 95 % interval of L_u at the largest of predict.budgets is at most
    /// this share of L_u, as 0.02
    #[arg(long, value_name = "WIDTH", requires = "rounds", value_parser = share)]
    pub until: Option<f64>,
    /// Memory for all jobs together, as in 8GB; by default all that is free at the start
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes)]
    pub memory: Option<u64>,
    /// Follow training in an experiment tracker
    #[arg(long, value_parser = a_track(), value_name = "TRACKER")]
    pub track: Option<Track>,
}

impl RunArgs {
    /// All that is missing of a sweep, on an engine.
    pub fn of(sweep: SweepArgs, engine: &'static dyn Engine) -> Self {
        Self { sweep, engine, options: RunOptions::default(), said_as: vec!["run".to_string()] }
    }

    /// Whether the engine has what is asked of it.
    ///
    /// # Errors
    /// A sentence that names the engines that have.
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

    /// Whether what trains the runs can tell the tracker of them.
    ///
    /// # Errors
    /// A sentence that says what can.
    pub fn check_track(&self, sweep: &Sweep) -> Result<()> {
        match self.options.track {
            Some(track @ (Track::Wandb | Track::Mlflow)) if sweep.trainer.is_none() => bail!(
                "--track {} wants `trainer: torch`; the built-in trainer is followed by --track tensorboard",
                track.name()
            ),
            _ => Ok(()),
        }
    }

    /// What is only to be shown.
    pub fn preview(&self) -> Option<Preview> {
        let dry_run = self.options.dry_run.then_some(Preview::DryRun);
        dry_run.or_else(|| self.options.check.then_some(Preview::Check))
    }
}
