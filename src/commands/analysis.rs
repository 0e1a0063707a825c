//! What follows from records: table, laws, figures, predictions.

use anyhow::Result;
use isoflop::figures::Format;
use isoflop::files::atomic;
use isoflop::jobs::ResultsFolder;
use isoflop::laws::Laws;
use isoflop::record::{RunRecord, Tuned, table};
use isoflop::sweep::Sweep;
use isoflop::tokenizer::remarks;
use serde_json::json;

use super::finished::{self, Finished};
use super::output::Output;
use super::validate::gathered;
use super::{fit, plot, predict};

/// What follows from records, made or found in the folder; the tokenizers of the runs lie in `home`.
pub fn analysed(
    sweep: &Sweep,
    (folder, home): (&ResultsFolder, &ResultsFolder),
    records: &[RunRecord],
    output: &Output,
) -> Result<Finished> {
    let stamp = finished::stamp(sweep, folder, records);
    if let Some(finished) = Finished::again(folder, &stamp, output)? {
        return Ok(finished);
    }
    let n_warned = output.warned().len();
    table::write(folder.root(), records)?;
    let tuned = Tuned::of(records);
    tuned.told.iter().for_each(|told| output.warn(told));
    let laws = write_laws(sweep, folder, &tuned.records, output)?;
    let laws = laws.as_ref();
    let tokenizers = plot::tokenizers(home, output)?;
    let wanted = plot::Wanted::default();
    let drawn = plot::draw(folder, &tuned.records, laws, &tokenizers, &wanted, output)?;
    remarks(&tokenizers).iter().for_each(|remark| output.warn(remark));
    let predictions = match laws {
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
    let files = format!(
        "{}: {} finished runs{}, {} figures",
        folder.root().display(),
        records.len(),
        if laws.is_some() { ", laws.json" } else { "" },
        drawn.paths.len() / Format::ALL.len()
    );
    let story = |full| laws.map(|laws| fit::text(laws, &predictions, full)).unwrap_or_default();
    let texts = [false, true].map(|full| story(full) + &files);
    Finished::write(folder, stamp, document, texts, output.warned().split_off(n_warned))
}

/// Removes what an earlier state of the sweep had: it would be taken for this one's own.
pub fn forget(folder: &ResultsFolder) -> Result<()> {
    for file in ["laws.json", "prediction.json", "finished.json"] {
        atomic::remove(&folder.file(file))?;
    }
    Ok(())
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
            forget(folder)?;
            Ok(None)
        }
    }
}
