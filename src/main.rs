//! The `isoflop` program: reads the command line, calls one command, returns its exit code.

mod commands;

use std::process::ExitCode;

use clap::Parser;
use commands::Cli;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    let cli = Cli::parse();
    match commands::dispatch(cli) {
        Ok(exit) => exit.into(),
        Err(error) => commands::report(&error).into(),
    }
}
