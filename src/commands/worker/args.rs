//! The command lines of `isoflop worker` and `isoflop guard`, which other commands give.

use std::path::PathBuf;

use clap::Args;
use isoflop::engine::{ENGINES, Engine};
use isoflop::jobs::JobKind;
use isoflop::ops::DeviceName;

use crate::commands::args::{an_engine, device};

#[derive(Args)]
pub struct WorkerArgs {
    pub results: PathBuf,
    #[arg(required_unless_present_any = ["chunk", "fit"], requires = "id")]
    pub kind: Option<JobKind>,
    pub id: Option<String>,
    /// The engine of a submission
    #[arg(long, value_parser = an_engine(), default_value = ENGINES[0].name())]
    pub engine: &'static dyn Engine,
    /// A submission, for --chunk and --fit
    #[arg(long)]
    pub generation: Option<u32>,
    /// An array of it
    #[arg(long)]
    pub stage: Option<String>,
    /// A task of the array: do its jobs
    #[arg(long, conflicts_with = "kind", requires_all = ["generation", "stage"])]
    pub chunk: Option<usize>,
    /// Fit the laws
    #[arg(long, conflicts_with_all = ["kind", "chunk"])]
    pub fit: bool,
    #[arg(long, value_parser = device(), default_value = "flex")]
    pub device: DeviceName,
}

#[derive(Args)]
pub struct GuardArgs {
    /// Held for as long as a program of the run may live
    pub lock: PathBuf,
    /// What the program's environment says
    pub mark: String,
}
