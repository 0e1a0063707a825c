//! [`ScoreRow`]: a system's scores, published or one's own, and their table.

use std::collections::BTreeMap;
use std::path::Path;

use polars::prelude::*;
use serde::Serialize;

use super::scored_run::ScoredRun;
use super::table::{TableError, write_frame};
use crate::scores::published::{self, Printed, Published};

/// A system on a data set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScoreRow {
    pub system: String,
    pub dataset: String,
    /// Rows of different evaluators are not comparable.
    pub evaluator: String,
    pub source: String,
    /// By name.
    pub scores: BTreeMap<String, Printed>,
}

impl ScoreRow {
    /// A published one.
    pub fn of_published(row: &Published) -> Self {
        Self {
            system: row.system.to_string(),
            dataset: row.dataset.to_string(),
            evaluator: row.evaluator.to_string(),
            source: row.source.to_string(),
            scores: row.scores.iter().map(|(name, score)| (name.to_string(), *score)).collect(),
        }
    }

    /// A run of a sweep.
    pub fn of_run(sweep: &str, run: &ScoredRun) -> Self {
        let ScoredRun { generator, n_vocab, budget_flops, .. } = run;
        let score = |name: &str| {
            let [mean, half_width] = run.score(name)?;
            Some((name.to_string(), Printed { mean, half_width: Some(half_width) }))
        };
        Self {
            system: format!("{generator} {budget_flops:.0e}"),
            dataset: sweep.to_string(),
            evaluator: run.evaluator_id.clone(),
            source: format!("{sweep}: V = {n_vocab}, N_nv = {}", run.params_nonvocab),
            scores: published::names().filter_map(score).collect(),
        }
    }
}

/// Writes `published.parquet` and `published.csv`, each whole, by rename.
///
/// # Errors
/// A file cannot be written.
pub fn write_published(folder: &Path, rows: &[ScoreRow]) -> Result<(), TableError> {
    let frame = frame(rows).map_err(|error| TableError::new(folder, error))?;
    write_frame(folder, "published", frame)
}

fn frame(rows: &[ScoreRow]) -> PolarsResult<DataFrame> {
    let texts = |name: &str, of: fn(&ScoreRow) -> &str| {
        Column::new(name.into(), rows.iter().map(of).collect::<Vec<_>>())
    };
    let mut columns = vec![
        texts("system", |row| &row.system),
        texts("dataset", |row| &row.dataset),
        texts("evaluator", |row| &row.evaluator),
        texts("source", |row| &row.source),
    ];
    for name in published::names() {
        let means: Vec<Option<f64>> =
            rows.iter().map(|row| Some(row.scores.get(name)?.mean)).collect();
        let halves: Vec<Option<f64>> =
            rows.iter().map(|row| row.scores.get(name)?.half_width).collect();
        columns.push(Column::new(name.into(), means));
        columns.push(Column::new(format!("{name}_half_width").into(), halves));
    }
    DataFrame::new(rows.len(), columns)
}
