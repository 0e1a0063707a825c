//! The command line, as it is typed.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use isoflop::engine::{ENGINES, Engine, Preview, engine};
use isoflop::jobs::JobKind;
use isoflop::ops::DeviceName;
use isoflop::units::parse_bytes;

use super::fit::FitArgs;

/// Scaling-law experiments for autoregressive motion generation: run an IsoFLOP sweep, regenerate
/// its figures, predict the best configuration for a budget.
#[derive(Parser)]
#[command(version, about)]
pub struct Cli {
    #[command(flatten)]
    pub common: Common,
    #[command(subcommand)]
    pub command: Command,
}

/// What every command takes.
#[derive(Args, Clone, Debug)]
pub struct Common {
    /// Print one JSON document on standard output, everything else on standard error
    #[arg(long, global = true)]
    pub json: bool,
    /// Print results and errors only
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Say more; twice for still more
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
}

#[derive(Subcommand)]
pub enum Command {
    /// Expand and price a sweep; train nothing
    Plan(PlanArgs),
    /// Run what is missing of a sweep, then fit, plot and predict
    Run(RunArgs),
    /// How far a sweep is, what runs, what failed and how to try it again
    Status(StatusArgs),
    /// End a sweep cleanly, wherever it runs; what is finished stays
    Cancel(CancelArgs),
    /// Fit laws to a sweep, or to any table of runs
    Fit(FitArgs),
    /// Draw every figure of a sweep again, from its table alone
    Plot(PlotArgs),
    /// The optimal configuration for a budget
    Predict(PredictArgs),
    /// Write a sweep's results in another form
    Export(ExportArgs),
    /// Do one job of a sweep; started by `run`
    #[command(hide = true)]
    Worker(WorkerArgs),
    /// Outlive a worker for as long as the program that it started; started by `worker`
    #[command(hide = true)]
    Guard(GuardArgs),
}

/// A sweep file and what is laid over it.
#[derive(Args)]
pub struct SweepArgs {
    /// The sweep file
    pub sweep: PathBuf,
    /// Lay a setting over the file, as train.min_steps=100; may be given again
    #[arg(long = "set", value_name = "PATH=VALUE")]
    pub settings: Vec<String>,
    /// The folder in which the sweep's own folder lies
    #[arg(long, default_value = "results", value_name = "DIR")]
    pub out: PathBuf,
    /// Jobs side by side, one thread each; by default one a core, or one on a GPU
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// Where tensors live
    #[arg(long, value_parser = device(), default_value = "flex")]
    pub device: DeviceName,
}

impl SweepArgs {
    /// Jobs side by side: by default one a core, and one on a GPU, whose memory is not known here.
    pub fn slots(&self) -> usize {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let default = || if self.device.is_processor() { cores() } else { 1 };
        self.jobs.map_or_else(default, usize::from)
    }
}

/// The parser of a device's name.
fn device() -> impl TypedValueParser<Value = DeviceName> {
    let names = DeviceName::ALL.map(|(name, about)| PossibleValue::new(name.name()).help(about));
    PossibleValuesParser::new(names).map(|name| name.parse().expect("one of the possible values"))
}

/// The parser of an engine's name.
fn an_engine() -> impl TypedValueParser<Value = &'static dyn Engine> {
    let names = ENGINES.map(|engine| PossibleValue::new(engine.name()).help(engine.about()));
    PossibleValuesParser::new(names).map(|name| engine(&name).expect("one of the possible values"))
}

#[derive(Args)]
pub struct PlanArgs {
    #[command(flatten)]
    pub sweep: SweepArgs,
}

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

#[derive(Args)]
pub struct StatusArgs {
    /// A sweep's folder
    pub results: PathBuf,
}

#[derive(Args)]
pub struct CancelArgs {
    /// A sweep's folder
    pub results: PathBuf,
}

#[derive(Args)]
pub struct PlotArgs {
    /// A sweep's folder
    pub results: PathBuf,
}

#[derive(Args)]
pub struct PredictArgs {
    /// Budgets in FLOPs, as 1e18
    #[arg(required = true, value_parser = budget)]
    pub budgets: Vec<f64>,
    /// A sweep's folder, a laws.json, or scamo for the published law
    #[arg(long, default_value = "scamo")]
    pub law: String,
}

pub fn budget(text: &str) -> Result<f64, String> {
    match text.replace('_', "").parse::<f64>() {
        Ok(budget) if budget > 0.0 && budget.is_finite() => Ok(budget),
        _ => Err(format!("{text} is not a number of FLOPs, as 1e18")),
    }
}

#[derive(Args)]
pub struct ExportArgs {
    /// A sweep's folder
    pub results: PathBuf,
    /// The form
    #[arg(long, value_enum)]
    pub to: ExportForm,
    /// The folder to write to
    #[arg(long, default_value = "notebooks-export")]
    pub out: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ExportForm {
    /// A Jupyter notebook that reads the sweep's table and laws
    Notebook,
}

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
