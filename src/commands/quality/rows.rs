//! Scored runs, by the evaluator that scored them.

use crate::commands::prelude::*;
use isoflop::record::Quality;
use isoflop::spec::ScoresSpec;

/// Runs of a folder that are scored as the sweep says: by the sweep's evaluator, the best FID first, and by each
/// evaluator that it had before.
pub fn scored_rows(
    sweep: &Sweep,
    folder: &ResultsFolder,
    records: &[RunRecord],
    output: &Output,
) -> Result<(Vec<Quality>, Vec<Vec<Quality>>)> {
    let mut by_evaluator = by_evaluator(sweep, folder, records, output)?;
    // The evaluators that the sweep describes.
    let present = match &sweep.evaluator {
        Some(section) => folder.gates_of(section, |line| output.warn(&line))?,
        None => Vec::new(),
    };
    let is_present = |id: &String| present.iter().any(|report| report.evaluator_id == *id);
    let candidates = by_evaluator.iter().filter(|(id, _)| is_present(id));
    let most = candidates.max_by_key(|(_, rows)| rows.len()).map(|(id, _)| id.clone());
    let mut own = most.and_then(|id| by_evaluator.remove(&id)).unwrap_or_default();
    let fid = |row: &Quality| row.mean("fid").unwrap_or(f64::INFINITY);
    own.sort_by(|a, b| fid(a).total_cmp(&fid(b)));
    Ok((own, by_evaluator.into_values().collect()))
}

/// All scores by the sweep's settings; such by settings that it had before lie there too.
fn by_evaluator(
    sweep: &Sweep,
    folder: &ResultsFolder,
    records: &[RunRecord],
    output: &Output,
) -> Result<BTreeMap<String, Vec<Quality>>> {
    let wanted = sweep.scores.as_ref().map(ScoresSpec::of_a_run);
    let by_id: BTreeMap<&str, &RunRecord> =
        records.iter().map(|record| (record.planned.run_id.as_str(), record)).collect();
    let mut by_evaluator: BTreeMap<String, Vec<Quality>> = BTreeMap::new();
    for scores in folder.all_scores(|line| output.warn(&line))? {
        let record = by_id.get(scores.run_id.as_str());
        if let Some(record) = record.filter(|_| wanted.as_ref() == Some(&scores.spec)) {
            let row = scores.quality((*record).clone());
            by_evaluator.entry(row.evaluator_id.clone()).or_default().push(row);
        }
    }
    Ok(by_evaluator)
}
