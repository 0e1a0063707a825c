//! What follows from the records of a sweep: table, laws, figures, predictions.

use anyhow::{Context, Result};
use isoflop::figures::Drawn;
use isoflop::files::{atomic, read_if_there};
use isoflop::jobs::ResultsFolder;
use isoflop::laws::Laws;
use isoflop::record::{RunRecord, table};
use isoflop::sweep::{self, Sweep};
use isoflop::tokenizer::remarks;
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::json;

use super::finished::{self, Finished};
use super::output::Output;
use super::validate::gathered;
use super::{fit, plot, predict};

/// Table, laws, figures, predictions: all from the records of finished runs.
///
/// What was made of the same records and the same settings before is only shown again.
///
/// The folder alone says what was planned, so that whoever trained the runs can have this done.
pub fn finish(folder: &ResultsFolder, output: &Output) -> Result<()> {
    let sweep = sweep::read(&folder.file("sweep.yaml"), &[])?;
    let records = gather(folder, output)?;
    let stamp = finished::stamp(&sweep, folder, &records);
    let finished = match Finished::again(folder, &stamp, output)? {
        Some(finished) => finished,
        None => analyse(&sweep, folder, &records, stamp, output)?,
    };
    let text = if output.full { &finished.full } else { &finished.text };
    Ok(output.result(&finished.document, text)?)
}

/// The table alone.
pub fn tabulate(folder: &ResultsFolder, output: &Output) -> Result<()> {
    let records = gather(folder, output)?;
    Ok(table::write(folder.root(), &records)?)
}

fn analyse(
    sweep: &Sweep,
    folder: &ResultsFolder,
    records: &[RunRecord],
    stamp: String,
    output: &Output,
) -> Result<Finished> {
    let n_warned = output.warned().len();
    table::write(folder.root(), records)?;
    let laws = write_laws(sweep, folder, records, output)?;
    let tokenizers = plot::tokenizers(folder, output)?;
    let drawn = plot::draw(folder, records, laws.as_ref(), &tokenizers, output)?;
    remarks(&tokenizers).iter().for_each(|remark| output.warn(remark));
    let predictions = match &laws {
        Some(laws) => predict::write(folder, laws, &sweep.predict.budgets, output)?,
        None => Vec::new(),
    };
    let document = json!({
        "results": folder.root(),
        "runs": records.len(),
        "laws": laws,
        "predictions": predictions,
        "figures": drawn.paths,
    });
    let story = |full| story(sweep, folder, records, laws.as_ref(), &predictions, &drawn, full);
    let texts = [story(false), story(true)];
    Finished::write(folder, stamp, document, texts, output.warned().split_off(n_warned))
}

fn write_laws(
    sweep: &Sweep,
    folder: &ResultsFolder,
    records: &[RunRecord],
    output: &Output,
) -> Result<Option<Laws>> {
    match fit::fit_records(records, &fit::options(sweep)) {
        Ok(mut laws) => {
            laws.judgement.validations = gathered(folder, output);
            atomic::write_json(&folder.file("laws.json"), &laws)?;
            Ok(Some(laws))
        }
        Err(error) => {
            output.warn(&format!("no laws: {error:#}"));
            // Those of an earlier state of the sweep would be taken for its own.
            atomic::remove(&folder.file("laws.json"))?;
            atomic::remove(&folder.file("prediction.json"))?;
            Ok(None)
        }
    }
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

/// What a person sees at the end.
fn story(
    sweep: &Sweep,
    folder: &ResultsFolder,
    records: &[RunRecord],
    laws: Option<&Laws>,
    predictions: &[isoflop::predict::Prediction],
    drawn: &Drawn,
    full: bool,
) -> String {
    let mut parts: Vec<String> = Vec::new();
    parts.extend(laws.map(|laws| fit::text(laws, predictions, full)));
    let root = folder.root().display();
    parts.push(format!(
        "{}: {} finished runs in {root}/runs.parquet\n{} figures in {root}/figures",
        sweep.name,
        records.len(),
        drawn.paths.len() / 2
    ));
    parts.join("\n")
}
