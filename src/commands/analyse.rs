//! Turns the records of a sweep into table, laws, figures and predictions.

use super::generators::{draw, parted};
use super::output::table as columns;
use super::plot::{analysed, forget};
use super::prelude::*;
use super::quality::Scored;
use isoflop::figures::Format;
use isoflop::record::table;
use rayon::prelude::*;

/// Makes table, laws, figures and predictions from the records of finished runs.
///
/// Results of the same records and settings are shown again, not recomputed.
///
/// The plan is read from the folder alone, so any engine can call this.
pub fn finish(folder: &ResultsFolder, output: &Output) -> Result<Exit> {
    let sweep = folder.sweep()?;
    let records = gather(folder, output)?;
    if records.is_empty() {
        // An empty table, without laws and figures.
        table::write(folder.root(), &[])?;
        forget(folder)?;
        let root = folder.root();
        let document = json!({
            "results": root, "runs": 0, "laws": null, "predictions": [], "figures": [],
        });
        return output.result(&document, &format!("{}: no run is done yet", root.display()));
    }
    let by_generator = parted(&records);
    // Before the laws: the check for unchanged results compares the figures in the folder.
    let scored = Scored::of(&sweep, folder, &records, output)?;
    let (mut document, mut text) = if by_generator.len() > 1 {
        table::write(folder.root(), &records)?;
        of_several(&sweep, folder, &by_generator, output)?
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

/// Fits laws for each generator by itself. Returns the text to print.
fn of_several(
    sweep: &Sweep,
    folder: &ResultsFolder,
    by_generator: &BTreeMap<String, Vec<RunRecord>>,
    output: &Output,
) -> Result<(Value, String)> {
    forget(folder)?;
    let figure = draw(sweep, folder, by_generator, &Format::ALL)?;
    let mut documents = BTreeMap::new();
    for (name, records) in by_generator {
        let own = folder.of_generator(name);
        std::fs::create_dir_all(own.root())?;
        let titled = Sweep { name: format!("{} {name}", sweep.name), ..sweep.clone() };
        output.note(&format!("laws of {name}, from {} runs:", records.len()));
        documents
            .insert(name.clone(), analysed(&titled, (&own, folder), records, output)?.document);
    }
    let text = side_by_side(folder, &documents, by_generator);
    let document = json!({
        "results": folder.root(),
        "runs": by_generator.values().map(Vec::len).sum::<usize>(),
        "generators": documents,
        "figures": figure,
    });
    Ok((document, text))
}

/// A line per generator: its exponents, and its prediction for the first budget asked for.
fn side_by_side(
    folder: &ResultsFolder,
    documents: &BTreeMap<String, Value>,
    by_generator: &BTreeMap<String, Vec<RunRecord>>,
) -> String {
    let number = |value: &Value, digits: usize| dash(value.as_f64(), |x| format!("{x:.digits$}"));
    let row = |(name, document): (&String, &Value)| {
        let exponent = |of: &str| number(&document["laws"]["power_laws"][of]["exponent"], 3);
        let prediction = &document["predictions"][0];
        let at = prediction["budget_flops"].as_f64();
        let at = at.map_or_else(String::new, |budget| format!(" at {budget:e}"));
        let [size, vocab, tokens] = ["params_nonvocab", "params_vocab", "tokens"].map(exponent);
        let predicted = number(&prediction["loss_normalised"], 3) + &at;
        [name.clone(), by_generator[name].len().to_string(), size, vocab, tokens, predicted]
    };
    let heads = ["<generator", "runs", "N_nv in C", "N_v in C", "D in C", "<L_u predicted"];
    let text = columns(heads, documents.iter().map(row));
    let root = folder.root().display();
    text + &format!(
        "\ntable     {root}/runs.parquet\nfigure    {root}/figures/generators.svg\n\
         each      {root}/generators/<generator>: laws.json, figures\n          \
         isoflop predict C --law {root}/generators/<generator>\n"
    )
}

/// Writes the table alone.
pub fn tabulate(folder: &ResultsFolder, output: &Output) -> Result<()> {
    let records = gather(folder, output)?;
    Ok(table::write(folder.root(), &records)?)
}

/// The part of `plan.json` that is read.
#[derive(Deserialize)]
struct Planned {
    runs: Vec<PlannedRun>,
}

#[derive(Deserialize)]
struct PlannedRun {
    run_id: String,
}

/// The ids of the runs in the plan that a folder holds; `None` if it holds none.
///
/// # Errors
/// The plan cannot be read.
pub fn planned_runs(folder: &ResultsFolder) -> Result<Option<Vec<String>>, FileError> {
    let plan: Option<Planned> = read_if_there(&folder.file("plan.json"))?;
    Ok(plan.map(|plan| plan.runs.into_iter().map(|run| run.run_id).collect()))
}

/// The records of the plan's runs; a damaged one is left out with a warning.
fn gather(folder: &ResultsFolder, output: &Output) -> Result<Vec<RunRecord>> {
    let runs = planned_runs(folder)?;
    let runs = runs.with_context(|| format!("{} has no plan", folder.root().display()))?;
    let read: Vec<_> = runs.par_iter().map(|run_id| folder.record(run_id)).collect();
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
