//! `isoflop published`: numbers that papers print, with the best runs of sweeps beside scores of motions.

use super::prelude::*;
use clap::builder::PossibleValuesParser;
use isoflop::jobs::{JobId, JobKind};
use isoflop::plan::EvaluatorJob;
use isoflop::record::{ScoredRun, read_scores, row_of_run, write_published};
use isoflop::scores::published::{self, EVALUATORS, Printed, Row, TABLES};
use isoflop::spec::LoadedSpec;

#[derive(Args)]
pub struct PublishedArgs {
    /// Sweeps' folders with scores: adds the best run by FID of each generator
    pub results: Vec<PathBuf>,
    /// Only rows of this data set, e.g. HumanML3D
    #[arg(long)]
    pub dataset: Option<String>,
    /// Only this table, as CSV
    #[arg(
        long,
        value_name = "NAME",
        conflicts_with_all = ["results", "dataset"],
        value_parser = PossibleValuesParser::new(TABLES.iter().map(|table| table.name)),
        hide_possible_values = true,
    )]
    pub table: Option<String>,
    /// The folder to write published.parquet and published.csv to, a line a number
    #[arg(long)]
    pub out: Option<PathBuf>,
}

pub fn published(args: &PublishedArgs, output: &Output) -> Result<Exit> {
    let wanted = |row: &Row| {
        let dataset = &args.dataset;
        dataset.as_ref().is_none_or(|dataset| dataset.eq_ignore_ascii_case(&row.dataset))
            && args.table.as_ref().is_none_or(|table| *table == row.table)
    };
    let mut rows: Vec<Row> = published::rows().into_iter().filter(wanted).collect();
    for path in &args.results {
        let folder = ResultsFolder::new(path);
        let runs = read_scores(folder.root()).context("its scores; `isoflop run` writes them")?;
        rows.extend(best(&runs).map(|run| row_beside(&folder, run)));
    }
    if let Some(out) = &args.out {
        write_published(out, &rows)?;
    }
    let text = match args.table.as_deref().and_then(published::named) {
        Some(table) => table.csv.trim_end().to_string(),
        None => text(&rows),
    };
    output.result(&json!({ "rows": rows, "sources": published::SOURCES }), &text)
}

/// A run as a row, by the published name of its evaluator if that was loaded.
fn row_beside(folder: &ResultsFolder, run: &ScoredRun) -> Row {
    let row = row_of_run(&folder.name(), run);
    let job = JobId::new(JobKind::Evaluator, &run.evaluator_id);
    let judge: Option<EvaluatorJob> = folder.known_spec(&job);
    let Some(LoadedSpec { name, .. }) = judge.and_then(|judge| judge.spec.loaded) else {
        return row;
    };
    // Published cosines are of other networks than the rest of a row.
    let scores = row.scores.into_iter().filter(|(name, _)| name != "cosine").collect();
    Row { evaluator: name, scores, ..row }
}

/// The run with the lowest FID of each generator.
fn best(runs: &[ScoredRun]) -> impl Iterator<Item = &ScoredRun> {
    let fid = |run: &ScoredRun| run.score("fid").map_or(f64::INFINITY, |[mean, _]| mean);
    let mut best: BTreeMap<&str, &ScoredRun> = BTreeMap::new();
    for run in runs {
        let kept = best.entry(&run.generator).or_insert(run);
        if fid(run) < fid(kept) {
            *kept = run;
        }
    }
    best.into_values()
}

/// Scores of motions, and which further tables there are.
fn text(rows: &[Row]) -> String {
    let title = |row: &Row| published::named(&row.table);
    let groups = rows
        .chunk_by(|a, b| {
            (&a.table, &a.evaluator, &a.dataset) == (&b.table, &b.evaluator, &b.dataset)
        })
        .filter(|group| title(&group[0]).is_none_or(|table| table.is_of_motions()));
    let text: String = groups.map(of_group).collect();
    let others = TABLES.iter().filter(|table| !table.is_of_motions());
    let others = others.map(|table| [format!("  {}", table.name), table.title.to_string()]);
    format!(
        "{text}\nfurther tables, printed by `--table NAME`\n{}\nscores by different evaluators are not \
         comparable; sources: docs/published.md",
        table(["<", "<"], others)
    )
}

fn of_group(rows: &[Row]) -> String {
    let Row { evaluator, dataset, table: name, .. } = &rows[0];
    let about = EVALUATORS.iter().find(|(name, _)| name == evaluator);
    let about = match (about, published::named(name)) {
        (None, _) => {
            format!("evaluator {evaluator}, trained by isoflop: not comparable with the rest")
        }
        (Some((_, about)), Some(_)) => format!("evaluator: {about}"),
        (Some((name, _)), None) => format!(
            "the same evaluator as in tables of `{name}`, if its weights are the authors';\n\
             comparable if data and protocol are theirs too"
        ),
    };
    let title = published::named(name).map(|table| format!("{name}: {}\n", table.title));
    let row = |row: &Row| {
        let score = |name| row.scores.get(name).map(Printed::to_string).unwrap_or_default();
        let names = ["r_precision_1", "fid", "matching_distance", "multimodality"];
        let [first, fid, distance, multimodality] = names.map(score);
        [label(row, rows), first, fid, distance, multimodality]
    };
    let heads = [&*format!("<{dataset}"), "<R@1", "<FID", "<MM-Dist", "<MultiModality"];
    let title = title.unwrap_or_default();
    format!("\n{title}{about}\n{}", table(heads, rows.iter().map(row)))
}

/// The system, with its setting where the rows have several of it.
fn label(row: &Row, rows: &[Row]) -> String {
    let Row { system, setting, .. } = row;
    match rows.iter().filter(|other| other.system == *system).count() {
        1 => system.clone(),
        _ if system.is_empty() => setting.clone(),
        _ => format!("{system}, {setting}"),
    }
}
