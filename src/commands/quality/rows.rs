//! Scored runs, by the evaluator that scored them.

use crate::commands::prelude::*;
use isoflop::record::Quality;
use isoflop::spec::ScoresSpec;
use std::collections::BTreeSet;

/// Runs that are scored as the sweep says.
pub struct Rows {
    /// By the sweep's evaluator, the best FID first.
    pub own: Vec<Quality>,
    /// By each evaluator that the sweep had before.
    pub by_others: Vec<Vec<Quality>>,
}

impl Rows {
    /// Those of the scores that lie in a folder.
    pub fn of(
        sweep: &Sweep,
        folder: &ResultsFolder,
        records: &[RunRecord],
        output: &Output,
    ) -> Result<Self> {
        let mut by_evaluator = by_evaluator(sweep, folder, records, output)?;
        let present = present(sweep, folder, output)?;
        let candidates = by_evaluator.iter().filter(|(id, _)| present.contains(*id));
        let most = candidates.max_by_key(|(_, rows)| rows.len()).map(|(id, _)| id.clone());
        let mut own = most.and_then(|id| by_evaluator.remove(&id)).unwrap_or_default();
        let fid = |row: &Quality| row.mean("fid").unwrap_or(f64::INFINITY);
        own.sort_by(|a, b| fid(a).total_cmp(&fid(b)));
        Ok(Self { own, by_others: by_evaluator.into_values().collect() })
    }
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

/// The evaluators that the sweep describes.
fn present(sweep: &Sweep, folder: &ResultsFolder, output: &Output) -> Result<BTreeSet<String>> {
    let Some(section) = &sweep.evaluator else { return Ok(BTreeSet::new()) };
    let described = folder.gates_of(section, |line| output.warn(&line))?;
    Ok(described.into_iter().map(|report| report.evaluator_id).collect())
}
