//! What the scored runs of a sweep say: their table, their figure, and whether loss predicts quality.

mod best;
mod ranks;
mod text;

use std::collections::BTreeMap;

use anyhow::Result;
use isoflop::figures::draw_quality;
use isoflop::jobs::ResultsFolder;
use isoflop::record::{Quality, RunRecord, write_scores};
use isoflop::spec::ScoresSpec;
use isoflop::sweep::Sweep;
use serde_json::{Value, json};

use super::output::Output;
use best::{best, fid_laws};
use ranks::Ranks;
use text::text;

/// What is said of scored runs.
pub struct Scored {
    document: Value,
    text: String,
}

impl Scored {
    /// Writes the table and the figure of those runs that are scored; `None` where none is.
    pub fn of(
        sweep: &Sweep,
        folder: &ResultsFolder,
        records: &[RunRecord],
        output: &Output,
    ) -> Result<Option<Self>> {
        let rows = rows(sweep, folder, records, output)?;
        if rows.is_empty() {
            return Ok(None);
        }
        write_scores(folder.root(), &rows)?;
        let figures = match draw_quality(&folder.name(), &rows, &folder.file("figures")) {
            Ok(paths) => paths.to_vec(),
            Err(error) => {
                output.warn(&error.to_string());
                Vec::new()
            }
        };
        let (ranks, best) = (Ranks::of(&rows), best(&rows));
        let laws = fid_laws(&best);
        let text = text(folder, &rows, &ranks, (&best, &laws));
        let document = json!({
            "runs": rows.len(), "ranks": ranks, "best": best, "fid_laws": laws, "figures": figures,
        });
        Ok(Some(Self { document, text }))
    }

    /// A document and a text with what there is to say of scores.
    pub fn join(scored: Option<Self>, mut document: Value, text: &str) -> (Value, String) {
        match scored {
            None => (document, text.to_string()),
            Some(scored) => {
                document["scores"] = scored.document;
                (document, format!("{}\n\n{}", text.trim_end(), scored.text))
            }
        }
    }
}

/// Runs that are scored as the sweep says, the best FID first, of the evaluator that scored most of them.
fn rows(
    sweep: &Sweep,
    folder: &ResultsFolder,
    records: &[RunRecord],
    output: &Output,
) -> Result<Vec<Quality>> {
    let wanted = sweep.scores.as_ref().map(ScoresSpec::of_a_run);
    let by_id: BTreeMap<&str, &RunRecord> =
        records.iter().map(|record| (record.planned.run_id.as_str(), record)).collect();
    let mut by_evaluator: BTreeMap<String, Vec<Quality>> = BTreeMap::new();
    let all = folder.all_scores(|line| output.warn(&line))?;
    // Scores by settings that the sweep had before lie here too.
    for scores in all.into_iter().filter(|scores| wanted.as_ref() == Some(&scores.spec)) {
        if let Some(record) = by_id.get(scores.run_id.as_str()) {
            let row = scores.quality((*record).clone());
            by_evaluator.entry(row.evaluator_id.clone()).or_default().push(row);
        }
    }
    if by_evaluator.len() > 1 {
        output.warn("scores of several evaluators lie here; those of the one with most are shown");
    }
    let most = by_evaluator.into_values().max_by_key(Vec::len);
    let mut rows = most.unwrap_or_default();
    let fid = |row: &Quality| row.mean("fid").unwrap_or(f64::INFINITY);
    rows.sort_by(|a, b| fid(a).total_cmp(&fid(b)));
    Ok(rows)
}
