//! The records of a sweep, and what follows from them.

use anyhow::{Context, Result};
use isoflop::files::read_if_there;
use isoflop::jobs::ResultsFolder;
use isoflop::record::{RunRecord, table};
use isoflop::sweep;
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::json;

use super::exit::Exit;
use super::generators;
use super::generators::parted;
use super::output::Output;
use super::plot::{analysed, forget};
use super::quality::Scored;

/// Table, laws, figures, predictions: all from the records of finished runs.
///
/// What was made of the same records and the same settings before is only shown again.
///
/// The folder alone says what was planned, so that whoever trained the runs can have this done.
pub fn finish(folder: &ResultsFolder, output: &Output) -> Result<Exit> {
    let sweep = sweep::read(&folder.file("sweep.yaml"), &[])?;
    let records = gather(folder, output)?;
    if records.is_empty() {
        return nothing(folder, output);
    }
    let by_generator = parted(&records);
    // Before the laws: what they were made beside is compared by the figures that are there.
    let scored = Scored::of(&sweep, folder, &records, output)?;
    let (mut document, mut text) = if by_generator.len() > 1 {
        table::write(folder.root(), &records)?;
        generators::finish(&sweep, folder, &by_generator, output)?
    } else {
        let finished = analysed(&sweep, (folder, folder), &records, output)?;
        (finished.document, if output.full { finished.full } else { finished.text })
    };
    if let Some(scored) = scored {
        document["scores"] = scored.document;
        text = format!("{}\n\n{}", text.trim_end(), scored.text);
    }
    output.result(&document, &text)
}

/// What there is before the first run is done: an empty table, and no word of laws and figures.
fn nothing(folder: &ResultsFolder, output: &Output) -> Result<Exit> {
    table::write(folder.root(), &[])?;
    forget(folder)?;
    let root = folder.root();
    let document = json!({
        "results": root, "runs": 0, "laws": null, "predictions": [], "figures": [],
    });
    output.result(&document, &format!("{}: no run is done yet", root.display()))
}

/// The table alone.
pub fn tabulate(folder: &ResultsFolder, output: &Output) -> Result<()> {
    let records = gather(folder, output)?;
    Ok(table::write(folder.root(), &records)?)
}

/// What is read of `plan.json`.
#[derive(Deserialize)]
struct Planned {
    runs: Vec<PlannedRun>,
}

#[derive(Deserialize)]
struct PlannedRun {
    run_id: String,
}

/// The records of the plan's runs; one that is damaged is left out with a warning.
fn gather(folder: &ResultsFolder, output: &Output) -> Result<Vec<RunRecord>> {
    let plan: Option<Planned> = read_if_there(&folder.file("plan.json"))?;
    let plan = plan.with_context(|| format!("{} has no plan", folder.root().display()))?;
    let read: Vec<_> = plan.runs.par_iter().map(|run| folder.record(&run.run_id)).collect();
    let mut records: Vec<RunRecord> = Vec::new();
    for record in read {
        match record {
            Ok(record) => records.extend(record),
            Err(error) => output.warn(&error.to_string()),
        }
    }
    table::sort(&mut records);
    Ok(records)
}
