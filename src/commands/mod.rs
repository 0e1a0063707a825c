//! The commands: one file each, each telling its whole story.

mod analyse;
mod args;
mod cancel;
mod command_line;
mod context;
mod exit;
mod export;
mod failures;
mod finished;
mod fit;
mod output;
mod plan;
mod plan_text;
mod plot;
mod predict;
mod prepare;
mod run;
mod stale;
mod status;
mod status_text;
mod task;
mod worker;

pub use args::Cli;
pub use exit::{Exit, report};

use args::Command;

/// Calls the command that was asked for.
pub fn dispatch(cli: Cli) -> anyhow::Result<Exit> {
    let output = output::Output::new(&cli.common);
    match cli.command {
        Command::Plan(args) => plan::plan(&args, &output),
        Command::Run(args) => run::run(&args, &output),
        Command::Status(args) => status::status(&args, &output),
        Command::Cancel(args) => cancel::cancel(&args, &output),
        Command::Fit(args) => fit::fit(&args, &output),
        Command::Plot(args) => plot::plot(&args, &output),
        Command::Predict(args) => predict::predict(&args, &output),
        Command::Export(args) => export::export(&args, &output),
        Command::Worker(args) => worker::worker(&args, &output),
        Command::Guard(args) => worker::guard(&args),
    }
}
