//! [`Quality`]: a run's losses beside the scores of its motions, and their table, `scores.parquet` and
//! `scores.csv`.

use std::path::Path;

use polars::prelude::*;

use super::run_record::RunRecord;
use super::table::{TableError, write_frame};
use crate::scores::Repeated;

/// A run's facts and losses, and what its motions score.
#[derive(Clone, Debug, PartialEq)]
pub struct Quality {
    pub run: RunRecord,
    /// Scores of different evaluators are not comparable.
    pub evaluator_id: String,
    /// How far motions were moved away from those without text.
    pub guidance: f64,
    /// Each score with its name: that of a column.
    pub scores: Vec<(&'static str, Option<Repeated>)>,
}

impl Quality {
    /// The mean of a score.
    pub fn mean(&self, name: &str) -> Option<f64> {
        self.scores.iter().find(|(own, _)| *own == name)?.1.map(|score| score.mean)
    }

    /// The generator of the run; empty in records that do not say it.
    pub fn generator(&self) -> &str {
        self.run.planned.generator.as_deref().unwrap_or_default()
    }
}

/// Writes both forms of the table, each whole, by rename: a row a run, and of each score its mean and the
/// half of its 95 % interval.
///
/// # Errors
/// A file cannot be written.
pub fn write_scores(folder: &Path, rows: &[Quality]) -> Result<(), TableError> {
    let frame = frame(rows).map_err(|error| TableError::new(folder, error))?;
    write_frame(folder, "scores", frame)
}

fn frame(rows: &[Quality]) -> PolarsResult<DataFrame> {
    let texts = |name: &str, of: fn(&Quality) -> &str| {
        Column::new(name.into(), rows.iter().map(of).collect::<Vec<_>>())
    };
    let numbers = |name: &str, of: &dyn Fn(&Quality) -> Option<f64>| {
        Column::new(name.into(), rows.iter().map(of).collect::<Vec<_>>())
    };
    let mut columns = vec![
        texts("run_id", |row| &row.run.planned.run_id),
        texts("evaluator_id", |row| &row.evaluator_id),
        texts("generator", Quality::generator),
        numbers("params_nonvocab", &|row| Some(row.run.planned.params_nonvocab as f64)),
        numbers("n_vocab", &|row| Some(row.run.planned.n_vocab as f64)),
        numbers("budget_flops", &|row| Some(row.run.planned.budget_flops)),
        numbers("seed", &|row| row.run.planned.seed.map(|seed| seed as f64)),
        numbers("loss_normalised", &|row| row.run.loss_normalised().ok()),
        numbers("guidance", &|row| Some(row.guidance)),
    ];
    let names = rows.first().map(|row| row.scores.iter().map(|(name, _)| *name));
    for name in names.into_iter().flatten() {
        let of = |row: &Quality| row.scores.iter().find(|(own, _)| *own == name)?.1;
        columns.push(numbers(name, &|row| of(row).map(|score| score.mean)));
        let half = format!("{name}_half_width");
        columns.push(numbers(&half, &|row| of(row).map(|score| score.half_width)));
    }
    DataFrame::new(rows.len(), columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::tests::whole;

    #[test]
    fn a_row_has_the_loss_and_each_score_with_its_interval() {
        let fid = Repeated { mean: 0.5, half_width: 0.1, repeats: 20 };
        let scores = vec![("fid", Some(fid)), ("multimodality", None)];
        let row = Quality { run: whole(), evaluator_id: "e".into(), guidance: 3.0, scores };
        let place = tempfile::tempdir().unwrap();
        write_scores(place.path(), &[row]).unwrap();
        let csv = std::fs::read_to_string(place.path().join("scores.csv")).unwrap();
        let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
        let at = |name: &str| lines[1][lines[0].iter().position(|own| *own == name).unwrap()];
        assert_eq!((at("fid"), at("fid_half_width"), at("multimodality")), ("0.5", "0.1", ""));
        assert_eq!((at("run_id"), at("guidance")), (whole().planned.run_id.as_str(), "3.0"));
        assert!(place.path().join("scores.parquet").is_file());
    }
}
