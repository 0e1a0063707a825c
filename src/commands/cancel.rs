//! `isoflop cancel`: ends a sweep as Ctrl-C would, wherever it runs.

use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use isoflop::record::ResultsFolder;
use isoflop::schedule::SweepState;
use isoflop::schedule::presence::{ask_no_more, ask_to_end, is_held};
use isoflop::slurm::System;
use isoflop::slurm::cancel::{self, Cancelled};
use serde_json::json;

use super::args::CancelArgs;
use super::command_line::CommandLine;
use super::exit::Exit;
use super::output::Output;
use super::{slurm, slurm_status, status, status_text};

/// Far longer than a step and a checkpoint take.
const PATIENCE: Duration = Duration::from_secs(60);
const POLL: Duration = Duration::from_millis(100);

/// What became of the wish.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    NothingRan,
    Ended,
    /// Tasks of Slurm's that had to be killed: they go on from their last checkpoints.
    Killed,
    StillAtWork,
}

pub fn cancel(args: &CancelArgs, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    status::state_of(&folder)?;
    let on_slurm = end_on_slurm(&folder, output).context("asking Slurm to end it")?;
    let here = end(&folder, output).context("asking the scheduler to end")?;
    let end = if here == End::NothingRan { on_slurm } else { here };
    let state = status::state_of(&folder)?;
    let said = match end {
        End::NothingRan => "nothing is running here",
        End::Ended => "ended; what is finished stays",
        End::Killed => "ended, some of it by force; what is finished stays",
        End::StillAtWork => "still at work after a minute; it has been asked, and may yet end",
    };
    report(&folder, &state, end, said, output)?;
    Ok(if end == End::StillAtWork { Exit::SomeRunsFailed } else { Exit::Done })
}

/// Ends what Slurm has of the sweep.
fn end_on_slurm(folder: &ResultsFolder, output: &Output) -> Result<End> {
    let Some((settings, entries)) = slurm::of_folder(folder)? else { return Ok(End::NothingRan) };
    output.note("asking Slurm; where something runs, its checkpoints are waited for");
    Ok(match cancel::cancel(folder, &settings, &entries, &System)? {
        Cancelled::NothingThere => End::NothingRan,
        Cancelled::Ended => End::Ended,
        Cancelled::Killed => End::Killed,
        Cancelled::StillThere => End::StillAtWork,
    })
}

/// Asks until the folder is free. What waits for the folder is asked too, as it takes it up.
fn end(folder: &ResultsFolder, output: &Output) -> std::io::Result<End> {
    if !is_held(folder) {
        return Ok(End::NothingRan);
    }
    output.note("asked for an end; waiting for checkpoints to be written");
    let asked = Instant::now();
    while is_held_by_any(folder) {
        if asked.elapsed() > PATIENCE {
            return Ok(End::StillAtWork);
        }
        // A scheduler that has just begun forgets what was asked before it.
        ask_to_end(folder)?;
        std::thread::sleep(POLL);
    }
    ask_no_more(folder)?;
    Ok(End::Ended)
}

/// Whether a scheduler has the folder, or takes it up from the one that had it.
fn is_held_by_any(folder: &ResultsFolder) -> bool {
    is_held(folder) || {
        std::thread::sleep(POLL);
        is_held(folder)
    }
}

fn report(
    folder: &ResultsFolder,
    state: &SweepState,
    end: End,
    said: &str,
    output: &Output,
) -> Result<()> {
    let command = CommandLine::read(folder)?;
    let document = json!({
        "was_running": end != End::NothingRan,
        "ended": end != End::StillAtWork,
        "state": status::json(folder, state, &command),
    });
    let queue = slurm_status::look(folder, state)?;
    let text = status_text::text(&folder.name(), state, queue.as_ref(), &command);
    Ok(output.result(&document, &format!("{said}\n\n{text}"))?)
}
