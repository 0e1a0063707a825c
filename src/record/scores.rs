//! Tables of scores: `scores` of a sweep's runs, and `published` of systems.

use std::path::Path;

use polars::prelude::*;

use super::run_record::RunRecord;
use super::table::{TableError, checked, write_frame};
use crate::scores::Repeated;
use crate::scores::published::{Printed, Row, SCORES};
use crate::table::parquet_frame;

/// The suffix of a column of half-widths.
const HALF: &str = "_half_width";

/// A run's facts, losses and scores.
#[derive(Clone, Debug, PartialEq)]
pub struct Quality {
    pub run: RunRecord,
    /// Scores of different evaluators are not comparable.
    pub evaluator_id: String,
    /// Strength of classifier-free guidance.
    pub guidance: f64,
    /// Each score with its column name.
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
    write_frame(folder, "scores", score_frame(rows))
}

fn score_frame(rows: &[Quality]) -> PolarsResult<DataFrame> {
    let numbers = |name: &str, of: &dyn Fn(&Quality) -> Option<f64>| {
        Column::new(name.into(), rows.iter().map(of).collect::<Vec<_>>())
    };
    let mut columns = vec![
        texts(rows, "run_id", |row| &row.run.planned.run_id),
        texts(rows, "evaluator_id", |row| &row.evaluator_id),
        texts(rows, "generator", Quality::generator),
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
        let half = |row: &Quality| of(row).map(|score| score.half_width);
        columns.push(numbers(&format!("{name}{HALF}"), &half));
    }
    DataFrame::new(rows.len(), columns)
}

/// A run and its scores.
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

/// Reads `scores.parquet` of a sweep's folder.
///
/// # Errors
/// The file is missing or damaged, or a column has another type.
pub fn read_scores(folder: &Path) -> Result<Vec<ScoredRun>, TableError> {
    let path = folder.join("scores.parquet");
    let frame = parquet_frame(checked(&path)?).map_err(|error| TableError::new(&path, error))?;
    scored_runs(&frame.0).map_err(|error| TableError::new(&path, error))
}

fn scored_runs(frame: &DataFrame) -> PolarsResult<Vec<ScoredRun>> {
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
                .collect::<Result<_, _>>()?,
        })
    };
    (0..frame.height()).map(one).collect()
}

/// A run of a sweep as a row beside published ones.
pub fn row_of_run(sweep: &str, run: &ScoredRun) -> Row {
    let ScoredRun { generator, n_vocab, budget_flops, .. } = run;
    let score = |name: &str| {
        let [mean, half_width] = run.score(name)?;
        Some((name.to_string(), Printed { mean, half_width: Some(half_width) }))
    };
    Row {
        table: sweep.to_string(),
        dataset: sweep.to_string(),
        evaluator: run.evaluator_id.clone(),
        system: format!("{generator} {budget_flops:.0e}"),
        setting: format!("V = {n_vocab}, N_nv = {}", run.params_nonvocab),
        scores: SCORES.into_iter().filter_map(score).collect(),
    }
}

/// Writes `published.parquet` and `published.csv`, each whole, by rename: a line a number.
///
/// # Errors
/// A file cannot be written.
pub fn write_published(folder: &Path, rows: &[Row]) -> Result<(), TableError> {
    write_frame(folder, "published", published_frame(rows))
}

fn published_frame(rows: &[Row]) -> PolarsResult<DataFrame> {
    let numbers: Vec<(&Row, (&String, &Printed))> =
        rows.iter().flat_map(|row| row.scores.iter().map(move |score| (row, score))).collect();
    let (mean, half): (Vec<f64>, Vec<Option<f64>>) =
        numbers.iter().map(|(_, (_, printed))| (printed.mean, printed.half_width)).unzip();
    let columns = vec![
        texts(&numbers, "table", |(row, _)| &row.table),
        texts(&numbers, "dataset", |(row, _)| &row.dataset),
        texts(&numbers, "evaluator", |(row, _)| &row.evaluator),
        texts(&numbers, "system", |(row, _)| &row.system),
        texts(&numbers, "setting", |(row, _)| &row.setting),
        texts(&numbers, "metric", |(_, (name, _))| name),
        Column::new("value".into(), mean),
        Column::new("half_width".into(), half),
    ];
    DataFrame::new(numbers.len(), columns)
}

fn texts<R>(rows: &[R], name: &str, of: fn(&R) -> &str) -> Column {
    Column::new(name.into(), rows.iter().map(of).collect::<Vec<_>>())
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
