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
mod export;
#[cfg(feature = "train")]
mod feet;
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

pub use output::{Exit, refuse, report};

/// Scaling-law experiments for autoregressive motion generation: run an IsoFLOP sweep, regenerate
/// its figures, predict the best configuration for a budget.
#[derive(Parser)]
#[command(version, about)]
#[cfg_attr(
    not(feature = "train"),
    command(
        after_help = "This build has no training: `cargo install isoflop` builds all commands."
    )
)]
pub struct Cli {
    #[command(flatten)]
    common: args::Common,
    #[command(subcommand)]
    command: Command,
}

/// The commands, each with its arguments and its function; `"train":` marks those that need the feature `train`.
macro_rules! commands {
    (|$output:ident| $(
        $(#[$about:meta])* $($feature:literal:)? $name:ident $(($args:ident: $takes:ty))? => $call:expr,
    )*) => {
        #[derive(Subcommand)]
        enum Command {
            $($(#[$about])* $(#[cfg(feature = $feature)])? $name $(($takes))?,)*
        }

        /// Calls the command that was asked for.
        pub fn dispatch(cli: Cli) -> anyhow::Result<Exit> {
            let $output = &output::Output::new(&cli.common);
            match cli.command {
                $($(#[cfg(feature = $feature)])? Command::$name $(($args))? => $call,)*
            }
        }
    };
}

commands! { |output|
    /// Write a commented sweep file for your data, sized to a time
    "train": Init(args: init::InitArgs) => init::init(&args, output),
    /// Expand and price a sweep; train nothing
    "train": Plan(args: plan::PlanArgs) => plan::plan(&args, output),
    /// Run the missing jobs of a sweep, then fit, plot and predict
    "train": Run(args: run::RunArgs) => run::run(&args, output),
    /// Show a sweep's progress, its failures and the commands to retry them
    "train": Status(args: args::FolderArg) => status::status(&args, output),
    /// Stop a sweep cleanly, wherever it runs; finished jobs are kept
    "train": Cancel(args: args::FolderArg) => status::cancel(&args, output),
    /// Fit laws to a sweep, or to any table of runs
    Fit(args: fit::FitArgs) => fit::fit(&args, output),
    /// Redraw every figure of a sweep from its table
    Plot(args: plot::PlotArgs) => plot::plot(&args, output),
    /// Predict the optimal configuration for a budget
    Predict(args: predict::PredictArgs) => predict::predict(&args, output),
    /// Test the laws: forecast a budget beyond the fit, train there, compare
    "train": Validate(args: validate::ValidateArgs) => validate::validate(&args, output),
    /// Find learning rate, batch and schedule by trials, and write them as a `train` section
    "train": Tune(args: tune::TuneArgs) => tune::tune(&args, output),
    /// Train the tokenizers of a sweep, or compare several
    "train": Tokenizer(args: tokenizer::TokenizerArgs) => tokenizer::tokenizer(&args, output),
    /// Train the evaluator that scores motions, and show its gates
    "train": Evaluator(args: evaluator::EvaluatorArgs) => evaluator::evaluator(&args, output),
    /// Score motions of a run, or motions in files
    "train": Evaluate(args: evaluate::EvaluateArgs) => evaluate::evaluate(&args, output),
    /// List scores from papers next to the best runs of sweeps
    Published(args: published::PublishedArgs) => published::published(&args, output),
    /// Generate motions from captions with a trained run
    "train": Generate(args: generate::GenerateArgs) => generate::generate(&args, output),
    /// Turn motions into codes with a trained tokenizer
    "train": Tokenize(args: tokenize::TokenizeArgs) => tokenize::tokenize(&args, output),
    /// Turn codes back into motions
    "train": Detokenize(args: detokenize::DetokenizeArgs) => detokenize::detokenize(&args, output),
    /// Compare the laws of several studies, and list how their sweeps differ
    Compare(args: compare::CompareArgs) => compare::compare(&args, output),
    /// Make, check and count data sets
    Data(args: data::DataArgs) => data::data(&args, output),
    /// Write a sweep's results as one HTML page that needs no network
    Report(args: report::ReportArgs) => report::report(&args, output),
    /// Write a sweep's results in another form
    Export(args: export::ExportArgs) => export::export(&args, output),
    /// Check what this machine and this build can do
    "train": Doctor => doctor::doctor(output),
    /// Print the JSON Schema of sweep files, for editors
    Schema => completions::schema(output),
    /// Print shell completions
    Completions(args: completions::CompletionsArgs) =>
        completions::completions(&args, Cli::command(), output),
    /// Write manual pages
    Man(args: completions::ManArgs) => completions::man(&args, Cli::command(), output),
    /// Do one job of a sweep; started by `run`
    #[command(hide = true)] "train": Worker(args: worker::WorkerArgs) =>
        worker::worker(&args, output),
    /// Outlive a worker for as long as the program that it started; started by `worker`
    #[command(hide = true)] "train": Guard(args: worker::GuardArgs) => worker::guard(&args),
}

impl Cli {
    /// Whether results, and errors beside their sentence, are JSON documents.
    pub fn is_json(&self) -> bool {
        self.common.json
    }
}

/// Checks that arguments are UTF-8: outputs name files, and JSON is UTF-8 only.
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
