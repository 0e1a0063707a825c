//! `isoflop status`: how far a sweep is, from its folder, and from the engines that have some of it.

use anyhow::{Result, bail};
use isoflop::engine::ENGINES;
use isoflop::jobs::{ResultsFolder, SweepState, sweep_state};
use serde_json::{Value, json};

use super::args::FolderArg;
use super::command_line::CommandLine;
use super::exit::Exit;
use super::output::Output;
use super::status_text;

pub fn status(args: &FolderArg, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    let state = state_of(&folder)?;
    let (document, text) = told(&folder, &state)?;
    state.warnings.iter().for_each(|line| output.warn(line));
    output.result(&document, &text)
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

/// A state as a document and for a person: with what each engine says that has something of the sweep, and each
/// failure with the command that tries it again.
pub fn told(folder: &ResultsFolder, state: &SweepState) -> Result<(Value, String)> {
    let command = CommandLine::read(folder)?;
    let here = std::env::current_dir().unwrap_or_default();
    let mut engines = Vec::new();
    for engine in ENGINES {
        engines.extend(engine.status(folder, state)?.map(|said| (engine.name(), said)));
    }
    let mut document = json!(state);
    document["name"] = json!(folder.name());
    document["results"] = json!(folder.root());
    let shown = document["failures"].as_array_mut().into_iter().flatten();
    for (shown, failed) in shown.zip(&state.failures) {
        shown["retry"] = json!(command.said(Some(&here), &["--retry", &failed.id.id]));
        shown["log"] = json!(folder.job(&failed.id).join("log.txt"));
    }
    for (name, said) in &engines {
        document[*name] = said.document.clone();
    }
    let text =
        status_text::text(&folder.name(), state, &engines, &|more| command.said(Some(&here), more));
    Ok((document, text))
}
