//! The command line of `isoflop run`, as it is typed.

use std::path::PathBuf;

use clap::Args;
use isoflop::engine::{ENGINES, Engine, Preview};
use isoflop::units::parse_bytes;

use crate::commands::args::{SweepArgs, an_engine};

#[derive(Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub sweep: SweepArgs,
    /// Who does the jobs
    #[arg(long, value_parser = an_engine(), default_value = ENGINES[0].name())]
    pub engine: &'static dyn Engine,
    /// A file with the keys of the engine's section, laid over those of the sweep
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// Print what the engine would be given; give and change nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Ask the engine whether it would take the sweep; give and change nothing
    #[arg(long, conflicts_with = "dry_run")]
    pub check: bool,
    /// Stop at the first failure
    #[arg(long)]
    pub fail_fast: bool,
    /// Try again what failed before
    #[arg(long)]
    pub retry_failed: bool,
    /// Try this job again, and what it needs, by the id of its folder; may be given again
    #[arg(long, value_name = "ID")]
    pub retry: Vec<String>,
    /// Memory for all jobs together, as 8GB; by default what is available at the start
    #[arg(long, value_name = "BYTES", value_parser = parse_bytes)]
    pub memory: Option<u64>,
}

impl RunArgs {
    /// What is only to be shown.
    pub fn preview(&self) -> Option<Preview> {
        let dry_run = self.dry_run.then_some(Preview::DryRun);
        dry_run.or_else(|| self.check.then_some(Preview::Check))
    }
}
