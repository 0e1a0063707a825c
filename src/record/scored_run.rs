//! [`ScoredRun`]: a row of `scores.parquet`, read again.

use std::fs::File;
use std::path::Path;

use polars::prelude::*;

use super::table::TableError;

/// A run and what its motions score.
#[derive(Clone, Debug, PartialEq)]
pub struct ScoredRun {
    pub generator: String,
    pub evaluator_id: String,
    pub params_nonvocab: f64,
    pub n_vocab: f64,
    pub budget_flops: f64,
    /// By the name of the score: its mean, and the half of its 95 % interval.
    pub scores: Vec<(String, [f64; 2])>,
}

impl ScoredRun {
    /// The mean of a score, and the half of its interval.
    pub fn score(&self, name: &str) -> Option<[f64; 2]> {
        self.scores.iter().find(|(own, _)| own == name).map(|(_, score)| *score)
    }
}

/// What a column of half-widths is named after its score.
const HALF: &str = "_half_width";

/// Reads `scores.parquet` of a sweep's folder.
///
/// # Errors
/// The file is missing or damaged, or a column has another type.
pub fn read_scores(folder: &Path) -> Result<Vec<ScoredRun>, TableError> {
    let path = folder.join("scores.parquet");
    let failed = |error: &dyn std::fmt::Display| TableError::new(&path, error);
    let file = File::open(&path).map_err(|error| failed(&error))?;
    let frame = ParquetReader::new(file).finish().map_err(|error| failed(&error))?;
    rows(&frame).map_err(|error| failed(&error))
}

fn rows(frame: &DataFrame) -> PolarsResult<Vec<ScoredRun>> {
    let text = |name: &str, row: usize| -> PolarsResult<String> {
        Ok(frame.column(name)?.str()?.get(row).unwrap_or_default().to_string())
    };
    let number = |name: &str, row: usize| -> PolarsResult<Option<f64>> {
        Ok(frame.column(name)?.f64()?.get(row))
    };
    let names = frame.get_column_names();
    let scores: Vec<&str> = names.iter().filter_map(|name| name.strip_suffix(HALF)).collect();
    let one = |row: usize| {
        let of = |name: &&str| -> PolarsResult<Option<(String, [f64; 2])>> {
            let (mean, half) = (number(name, row)?, number(&format!("{name}{HALF}"), row)?);
            Ok(mean.zip(half).map(|(mean, half)| (name.to_string(), [mean, half])))
        };
        Ok(ScoredRun {
            generator: text("generator", row)?,
            evaluator_id: text("evaluator_id", row)?,
            params_nonvocab: number("params_nonvocab", row)?.unwrap_or(f64::NAN),
            n_vocab: number("n_vocab", row)?.unwrap_or(f64::NAN),
            budget_flops: number("budget_flops", row)?.unwrap_or(f64::NAN),
            scores: scores
                .iter()
                .filter_map(|name| of(name).transpose())
                .collect::<PolarsResult<_>>()?,
        })
    };
    (0..frame.height()).map(one).collect()
}
