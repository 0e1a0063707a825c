//! The commands: one file each, each telling its whole story.

#[cfg(feature = "train")]
mod analyse;
mod args;
mod compare;
mod completions;
#[cfg(feature = "train")]
mod context;
mod data;
#[cfg(feature = "train")]
mod detokenize;
#[cfg(feature = "train")]
mod doctor;
#[cfg(feature = "train")]
mod doubts;
#[cfg(feature = "train")]
mod evaluate;
#[cfg(feature = "train")]
mod evaluator;
mod exit;
mod export;
mod fit;
#[cfg(feature = "train")]
mod generate;
mod generators;
#[cfg(feature = "train")]
mod init;
mod output;
#[cfg(feature = "train")]
mod plan;
#[cfg(feature = "train")]
mod plan_text;
mod plot;
mod predict;
mod prelude;
mod published;
#[cfg(feature = "train")]
mod quality;
mod report;
#[cfg(feature = "train")]
mod run;
mod sizes;
#[cfg(feature = "train")]
mod status;
#[cfg(feature = "train")]
mod tokenize;
#[cfg(feature = "train")]
mod tokenizer;
#[cfg(feature = "train")]
mod tune;
#[cfg(feature = "train")]
mod validate;
#[cfg(feature = "train")]
mod worker;

use clap::{CommandFactory, Parser, Subcommand};

pub use exit::{Exit, refuse, report};

/// Scaling-law experiments for autoregressive motion generation: run an IsoFLOP sweep, regenerate
/// its figures, predict the best configuration for a budget.
#[derive(Parser)]
#[command(version, about)]
pub struct Cli {
    #[command(flatten)]
    common: args::Common,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    #[cfg(feature = "train")]
    /// Write a sweep file with comments, sized to a time, for one's data
    Init(init::InitArgs),
    #[cfg(feature = "train")]
    /// Expand and price a sweep; train nothing
    Plan(plan::PlanArgs),
    #[cfg(feature = "train")]
    /// Run what is missing of a sweep, then fit, plot and predict
    Run(run::RunArgs),
    #[cfg(feature = "train")]
    /// How far a sweep is, what runs, what failed and how to try it again
    Status(args::FolderArg),
    #[cfg(feature = "train")]
    /// End a sweep cleanly, wherever it runs; what is finished stays
    Cancel(args::FolderArg),
    /// Fit laws to a sweep, or to any table of runs
    Fit(fit::FitArgs),
    /// Draw every figure of a sweep again, from its table alone
    Plot(plot::PlotArgs),
    /// The optimal configuration for a budget
    Predict(predict::PredictArgs),
    #[cfg(feature = "train")]
    /// Test the laws: forecast a budget beyond the fit, train there, compare
    Validate(validate::ValidateArgs),
    #[cfg(feature = "train")]
    /// Find the learning rate, batch and schedule of a sweep by trials, as a `train` section
    Tune(tune::TuneArgs),
    #[cfg(feature = "train")]
    /// Train the tokenizers of a sweep, or compare several
    Tokenizer(tokenizer::TokenizerArgs),
    #[cfg(feature = "train")]
    /// Train what motions are scored by, and see what it is worth
    Evaluator(evaluator::EvaluatorArgs),
    #[cfg(feature = "train")]
    /// Score the motions of a run, or those of files
    Evaluate(evaluate::EvaluateArgs),
    /// Scores that papers print, with the best runs of sweeps beside them
    Published(published::PublishedArgs),
    #[cfg(feature = "train")]
    /// Make motions of captions with a trained run
    Generate(generate::GenerateArgs),
    #[cfg(feature = "train")]
    /// Turn motions into codes with a trained tokenizer
    Tokenize(tokenize::TokenizeArgs),
    #[cfg(feature = "train")]
    /// Turn codes back into motions
    Detokenize(detokenize::DetokenizeArgs),
    /// The laws of several studies side by side, and what differs in their sweeps
    Compare(compare::CompareArgs),
    /// Make, check and count data sets
    Data(data::DataArgs),
    /// A sweep's results as one page that opens without a network
    Report(report::ReportArgs),
    /// Write a sweep's results in another form
    Export(export::ExportArgs),
    #[cfg(feature = "train")]
    /// What this machine and this build can do
    Doctor,
    /// The JSON Schema of sweep files, for editors
    Schema,
    /// Print what completes commands in a shell
    Completions(completions::CompletionsArgs),
    /// Write manual pages
    Man(completions::ManArgs),
    #[cfg(feature = "train")]
    /// Do one job of a sweep; started by `run`
    #[command(hide = true)]
    Worker(worker::WorkerArgs),
    #[cfg(feature = "train")]
    /// Outlive a worker for as long as the program that it started; started by `worker`
    #[command(hide = true)]
    Guard(worker::GuardArgs),
}

impl Cli {
    /// Whether results, and errors beside their sentence, are JSON documents.
    pub fn is_json(&self) -> bool {
        self.common.json
    }
}

/// What is written names files, and its documents hold UTF-8 alone.
///
/// # Errors
/// The first word of the command line that is not UTF-8.
pub fn words_are_utf8() -> Result<(), clap::Error> {
    match std::env::args_os().find(|word| word.to_str().is_none()) {
        None => Ok(()),
        Some(word) => Err(Cli::command().error(
            clap::error::ErrorKind::InvalidUtf8,
            format!(
                "`{}` is not UTF-8, and what is written names files: rename it",
                word.display()
            ),
        )),
    }
}

/// Calls the command that was asked for.
pub fn dispatch(cli: Cli) -> anyhow::Result<Exit> {
    let output = output::Output::new(&cli.common);
    match cli.command {
        #[cfg(feature = "train")]
        Command::Init(args) => init::init(&args, &output),
        #[cfg(feature = "train")]
        Command::Plan(args) => plan::plan(&args, &output),
        #[cfg(feature = "train")]
        Command::Run(args) => run::run(&args, &output),
        #[cfg(feature = "train")]
        Command::Status(args) => status::status(&args, &output),
        #[cfg(feature = "train")]
        Command::Cancel(args) => status::cancel(&args, &output),
        Command::Fit(args) => fit::fit(&args, &output),
        Command::Plot(args) => plot::plot(&args, &output),
        Command::Predict(args) => predict::predict(&args, &output),
        #[cfg(feature = "train")]
        Command::Validate(args) => validate::validate(&args, &output),
        #[cfg(feature = "train")]
        Command::Tune(args) => tune::tune(&args, &output),
        #[cfg(feature = "train")]
        Command::Tokenizer(args) => tokenizer::tokenizer(&args, &output),
        #[cfg(feature = "train")]
        Command::Evaluator(args) => evaluator::evaluator(&args, &output),
        #[cfg(feature = "train")]
        Command::Evaluate(args) => evaluate::evaluate(&args, &output),
        Command::Published(args) => published::published(&args, &output),
        #[cfg(feature = "train")]
        Command::Generate(args) => generate::generate(&args, &output),
        #[cfg(feature = "train")]
        Command::Tokenize(args) => tokenize::tokenize(&args, &output),
        #[cfg(feature = "train")]
        Command::Detokenize(args) => detokenize::detokenize(&args, &output),
        Command::Compare(args) => compare::compare(&args, &output),
        Command::Data(args) => data::data(&args, &output),
        Command::Report(args) => report::report(&args, &output),
        Command::Export(args) => export::export(&args, &output),
        #[cfg(feature = "train")]
        Command::Doctor => doctor::doctor(&output),
        Command::Schema => completions::schema(&output),
        Command::Completions(args) => completions::completions(&args, Cli::command(), &output),
        Command::Man(args) => completions::man(&args, Cli::command(), &output),
        #[cfg(feature = "train")]
        Command::Worker(args) => worker::worker(&args, &output),
        #[cfg(feature = "train")]
        Command::Guard(args) => worker::guard(&args),
    }
}
