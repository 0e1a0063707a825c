//! Exit codes, lines on standard error, and how an error that ends the program is shown.

use isoflop::failure::Consequence;
use isoflop::files::failure_kind;
use isoflop::laws::FitError;
use isoflop::predict::PredictError;
use isoflop::sweep::SweepErrors;
use serde_json::json;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;

/// What the program tells its caller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    Done = 0,
    SomeRunsFailed = 1,
    Usage = 2,
    NotIdentifiable = 3,
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        ExitCode::from(exit as u8)
    }
}

/// Ends the program: with help where it was asked for, or with what is wrong with the command line.
pub fn refuse(error: &clap::Error) -> ! {
    if error.use_stderr() && std::env::args_os().any(|arg| arg == "--json") {
        let message = error.to_string();
        document(message.trim_start_matches("error: ").trim_end(), Exit::Usage);
    }
    error.exit()
}

/// Shows an error on standard error, and with `--json` as a document on standard output; says how to exit.
pub fn report(error: &anyhow::Error, json: bool) -> Exit {
    let exit = told(error);
    if json {
        let message = match error.downcast_ref::<SweepErrors>() {
            Some(errors) => errors.render(false),
            None => sentence(error),
        };
        document(&message, exit);
    }
    exit
}

/// An error as a document on standard output.
fn document(message: &str, exit: Exit) {
    let document = json!({ "error": { "message": message, "exit": exit as u8 } });
    // Nobody reads a pipe that is closed.
    let _ = writeln!(std::io::stdout(), "{document:#}");
}

/// An error and what caused it, each said once: some messages hold their causes already.
pub fn sentence(error: &anyhow::Error) -> String {
    let mut said = String::new();
    for cause in error.chain().map(ToString::to_string).filter(|cause| !cause.is_empty()) {
        if said.is_empty() {
            said = cause;
        } else if !said.contains(&cause) {
            said = format!("{said}: {cause}");
        }
    }
    said
}

fn told(error: &anyhow::Error) -> Exit {
    if let Some(errors) = error.downcast_ref::<SweepErrors>() {
        say(&errors.render(is_coloured()));
        return Exit::Usage;
    }
    say(&format!("error: {}", sentence(error)));
    if let Some(kind) = failure_kind(error.as_ref())
        && kind.consequence() == Consequence::StopsAll
    {
        say(&format!("  {}; then the same command goes on", kind.advice().unwrap_or("mend that")));
        return Exit::SomeRunsFailed;
    }
    let unidentifiable = error.downcast_ref::<FitError>().is_some_and(FitError::is_unidentifiable)
        || matches!(error.downcast_ref(), Some(PredictError::NoOptimum { .. }));
    if unidentifiable { Exit::NotIdentifiable } else { Exit::Usage }
}

/// A line on standard error; that nobody reads it any more is no error.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Whether standard error is a terminal that colours are wanted on.
pub fn is_coloured() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}
