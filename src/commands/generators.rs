//! A sweep with several generators: laws, figures and predictions of each in a folder of its own, and
//! all of them side by side.

use std::collections::BTreeMap;
use std::fmt::Write;

use anyhow::Result;
use isoflop::figures::Format;
use isoflop::jobs::ResultsFolder;
use isoflop::record::RunRecord;
use isoflop::sweep::Sweep;
use serde_json::{Value, json};

use super::by_generator::draw;
use super::exit::{dash, table};
use super::output::Output;
use super::plot::{analysed, forget};

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
