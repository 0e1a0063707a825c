//! `isoflop status`: how far a sweep is, from its folder, and from the engines that have some of it.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use isoflop::engine::{ENGINES, EngineState};
use isoflop::jobs::{ResultsFolder, SweepState, sweep_state};
use serde_json::{Value, json};

use super::command_line::CommandLine;
use super::exit::Exit;
use super::output::Output;
use super::status_text;

#[derive(Args)]
pub struct StatusArgs {
    /// A sweep's folder
    pub results: PathBuf,
}

pub fn status(args: &StatusArgs, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    let state = state_of(&folder)?;
    let command = CommandLine::read(&folder)?;
    let engines = engine_states(&folder, &state)?;
    let text = status_text::text(&folder.name(), &state, &engines, &command);
    state.warnings.iter().for_each(|line| output.warn(line));
    let mut document = json(&folder, &state, &command);
    for (name, state) in &engines {
        document[*name] = state.document.clone();
    }
    output.result(&document, &text)?;
    Ok(Exit::Done)
}

/// What each engine says that has something of the sweep.
pub fn engine_states(
    folder: &ResultsFolder,
    state: &SweepState,
) -> Result<Vec<(&'static str, EngineState)>> {
    let mut states = Vec::new();
    for engine in ENGINES {
        states.extend(engine.status(folder, state)?.map(|said| (engine.name(), said)));
    }
    Ok(states)
}

/// How far a sweep is; an error where the folder is no sweep's.
pub fn state_of(folder: &ResultsFolder) -> Result<SweepState> {
    match sweep_state(folder)? {
        Some(state) => Ok(state),
        None => bail!(
            "{0} is no sweep's folder: it has no plan.json, which `isoflop run` writes first",
            folder.root().display()
        ),
    }
}

/// The state as a JSON document, each failure with the command that tries it again.
pub fn json(folder: &ResultsFolder, state: &SweepState, command: &CommandLine) -> Value {
    let here = std::env::current_dir().unwrap_or_default();
    let mut document = json!(state);
    document["name"] = json!(folder.name());
    document["results"] = json!(folder.root());
    let shown = document["failures"].as_array_mut().into_iter().flatten();
    for (shown, failed) in shown.zip(&state.failures) {
        shown["retry"] = json!(command.retry_one_from(&here, &failed.id));
        shown["log"] = json!(folder.job(&failed.id).join("log.txt"));
    }
    document
}
