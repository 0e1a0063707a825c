//! A sweep with several generators: its runs parted by generator, laws, figures and predictions of each in a folder
//! of its own, and all of them side by side.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use isoflop::figures::{self, Format, GeneratorRuns, draw_alone};
use isoflop::jobs::ResultsFolder;
use isoflop::record::RunRecord;
use isoflop::sweep::{self, Sweep};
use serde_json::{Value, json};

use super::output::{Output, dash, table};
use super::plot::{analysed, forget};

/// The runs of each generator, by its name.
pub fn parted(records: &[RunRecord]) -> BTreeMap<String, Vec<RunRecord>> {
    let mut parted: BTreeMap<String, Vec<RunRecord>> = BTreeMap::new();
    for record in records {
        let generator = record.planned.generator.clone().unwrap_or_default();
        parted.entry(generator).or_default().push(record.clone());
    }
    parted
}

/// Refuses runs of several generators: a law of all of them would say nothing of any.
pub fn of_one(folder: &ResultsFolder, records: &[RunRecord]) -> Result<()> {
    let names: BTreeSet<&str> = records
        .iter()
        .map(|record| record.planned.generator.as_deref().unwrap_or_default())
        .collect();
    if let (Some(first), 2..) = (names.first(), names.len()) {
        bail!(
            "{} has runs of several generators, each with laws of its own; name the folder of one, as {}",
            folder.root().display(),
            folder.of_generator(first).root().display()
        );
    }
    Ok(())
}

/// The sweep's folder of the folder of one of its generators; any other folder itself.
pub fn home(folder: &ResultsFolder) -> ResultsFolder {
    let above = folder.root().parent().filter(|above| above.ends_with("generators"));
    let home = above.and_then(Path::parent).filter(|home| home.join("sweep.yaml").is_file());
    ResultsFolder::new(home.unwrap_or(folder.root()))
}

/// The sweep that filled a folder; of the folder of one of its generators, the sweep of that one alone.
pub fn sweep_of(folder: &ResultsFolder) -> Result<Sweep> {
    let home = home(folder);
    let file = home.file("sweep.yaml");
    if !file.exists() {
        let folder = folder.root().display();
        bail!("{folder} has no sweep.yaml; give the folder of a sweep");
    }
    let mut sweep = sweep::read(&file, &[])?;
    if home.root() != folder.root() {
        let own = folder.name();
        sweep.name = format!("{} {own}", sweep.name);
        sweep.generator.0.retain(|kind| kind.name() == own);
    }
    Ok(sweep)
}

/// The best runs of each generator side by side; gives the paths.
pub fn draw(
    sweep: &Sweep,
    folder: &ResultsFolder,
    by_generator: &BTreeMap<String, Vec<RunRecord>>,
    formats: &[Format],
) -> Result<Vec<PathBuf>> {
    let runs: Vec<GeneratorRuns> =
        by_generator.iter().map(|(name, records)| GeneratorRuns { name, records }).collect();
    let drawing = figures::generators(&sweep.name, &runs, sweep.flops.rule);
    Ok(draw_alone("generators", drawing, &folder.file("figures"), formats)?)
}

/// Laws for each generator: those of one would say nothing of another. Gives what there is to say.
pub fn finish(
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
    let text = text(folder, &documents, by_generator);
    let document = json!({
        "results": folder.root(),
        "runs": by_generator.values().map(Vec::len).sum::<usize>(),
        "generators": documents,
        "figures": figure,
    });
    Ok((document, text))
}

/// A line a generator: its exponents, and what it predicts for the first budget that is asked about.
fn text(
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
    let mut text = table(heads, documents.iter().map(row));
    let root = folder.root().display();
    let _ = writeln!(text, "\ntable     {root}/runs.parquet");
    let _ = writeln!(text, "figure    {root}/figures/generators.svg");
    let _ = writeln!(text, "each      {root}/generators/<generator>: laws.json, figures");
    let _ = writeln!(text, "          isoflop predict C --law {root}/generators/<generator>");
    text
}
