//! `isoflop cancel`: ends a sweep as Ctrl-C would, wherever it runs.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use isoflop::engine::{Cancelled, ENGINES};
use isoflop::jobs::{ResultsFolder, SweepState};
use serde_json::json;

use super::command_line::CommandLine;
use super::exit::Exit;
use super::output::Output;
use super::{status, status_text};

#[derive(Args)]
pub struct CancelArgs {
    /// A sweep's folder
    pub results: PathBuf,
}

pub fn cancel(args: &CancelArgs, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    status::state_of(&folder)?;
    let mut end = Cancelled::NothingRan;
    // Those that start work elsewhere first.
    for engine in ENGINES.into_iter().rev() {
        let asking = || format!("asking the engine {} to end", engine.name());
        end = end.max(engine.cancel(&folder, output).with_context(asking)?);
    }
    let state = status::state_of(&folder)?;
    report(&folder, &state, end, output)?;
    Ok(if end == Cancelled::StillAtWork { Exit::SomeRunsFailed } else { Exit::Done })
}

fn report(
    folder: &ResultsFolder,
    state: &SweepState,
    end: Cancelled,
    output: &Output,
) -> Result<()> {
    let said = match end {
        Cancelled::NothingRan => "nothing is running here",
        Cancelled::Ended => "ended; what is finished stays",
        Cancelled::Killed => "ended, some of it by force; what is finished stays",
        Cancelled::StillAtWork => {
            "still at work a minute after it was asked to end; it may yet end"
        }
    };
    let command = CommandLine::read(folder)?;
    let document = json!({
        "was_running": end != Cancelled::NothingRan,
        "ended": end != Cancelled::StillAtWork,
        "state": status::json(folder, state, &command),
    });
    let engines = status::engine_states(folder, state)?;
    let text = status_text::text(&folder.name(), state, &engines, &command);
    Ok(output.result(&document, &format!("{said}\n\n{text}"))?)
}
