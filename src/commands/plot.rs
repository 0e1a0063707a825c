//! `isoflop plot`: every figure of a sweep again, from its table and laws alone.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use isoflop::figures::{self, Drawn, FigureInput, LeftOut};
use isoflop::files::{atomic, read_if_there};
use isoflop::jobs::{ResultsFolder, frozen_sweep};
use isoflop::laws::Laws;
use isoflop::record::{RunRecord, table};
use isoflop::tokenizer::TokenizerMetrics;
use serde_json::json;

use super::by_generator::{draw as draw_side_by_side, home, parted};
use super::exit::Exit;
use super::output::Output;

#[derive(Args)]
pub struct PlotArgs {
    /// A sweep's folder
    pub results: PathBuf,
}

pub fn plot(args: &PlotArgs, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    let records = table::read(folder.root())?;
    let by_generator = parted(&records);
    let paths = match by_generator.len() {
        0 | 1 => of_one_generator(&folder, &records, output)?,
        _ => of_several_generators(&folder, &by_generator, output)?,
    };
    let text: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    output.result(&json!({ "figures": paths }), &text.join("\n"))?;
    Ok(Exit::Done)
}

fn of_one_generator(
    folder: &ResultsFolder,
    records: &[RunRecord],
    output: &Output,
) -> Result<Vec<PathBuf>> {
    let laws: Option<Laws> = read_if_there(&folder.file("laws.json"))?;
    let tokenizers = tokenizers(&home(folder), output)?;
    Ok(draw(folder, records, laws.as_ref(), &tokenizers, output)?.paths)
}

/// All of them side by side, then the figures of each.
fn of_several_generators(
    folder: &ResultsFolder,
    by_generator: &BTreeMap<String, Vec<RunRecord>>,
    output: &Output,
) -> Result<Vec<PathBuf>> {
    let sweep = frozen_sweep(folder)?;
    let mut paths = Vec::from(draw_side_by_side(&sweep, folder, by_generator)?);
    for (name, records) in by_generator {
        paths.extend(of_one_generator(&folder.of_generator(name), records, output)?);
    }
    Ok(paths)
}

/// The metrics of every tokenizer in a folder; a damaged one is left out with a warning.
pub fn tokenizers(folder: &ResultsFolder, output: &Output) -> Result<Vec<TokenizerMetrics>> {
    Ok(folder.all_metrics(|problem| output.warn(&problem))?)
}

/// Draws into the sweep's `figures` folder; what cannot be drawn is a warning, and an older file
/// that showed it is removed.
pub fn draw(
    folder: &ResultsFolder,
    records: &[RunRecord],
    laws: Option<&Laws>,
    tokenizers: &[TokenizerMetrics],
    output: &Output,
) -> Result<Drawn> {
    let name = folder.name();
    let input = FigureInput { title: &name, records, laws, tokenizers };
    let figures = folder.file("figures");
    let drawn = figures::draw_all(&input, &figures)?;
    for LeftOut { name, reason } in &drawn.left_out {
        output.warn(&format!("{name} is left out: {reason}"));
        for extension in ["svg", "png"] {
            atomic::remove(&figures.join(format!("{name}.{extension}")))?;
        }
    }
    Ok(drawn)
}
