//! The `isoflop` program: reads the command line, calls one command, returns its exit code.

#![cfg_attr(
    not(test),
    warn(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)
)]
#![cfg_attr(
    not(feature = "train"),
    expect(dead_code, unused_imports, reason = "commands that train use more of the others")
)]

mod commands;

use std::process::ExitCode;

use clap::Parser;
use commands::Cli;

#[global_allocator]
static ALLOCATOR: isoflop::machine::Allocator = isoflop::machine::Allocator;

fn main() -> ExitCode {
    ignore_file_size_signal();
    isoflop::machine::tell_of_cut_files();
    let cli = commands::words_are_utf8().and_then(|()| Cli::try_parse());
    let cli = cli.unwrap_or_else(|error| commands::refuse(&error));
    let json = cli.is_json();
    match commands::dispatch(cli) {
        Ok(exit) => exit.into(),
        Err(error) => commands::report(&error, json).into(),
    }
}

/// Makes a limit on file sizes an error of the write that meets it, not the end of the program.
fn ignore_file_size_signal() {
    use nix::sys::signal::{SigHandler, Signal, signal};
    // SAFETY: no handler is installed, and this is before any thread is started.
    let _ = unsafe { signal(Signal::SIGXFSZ, SigHandler::SigIgn) };
}
