//! `isoflop published`: scores from papers, next to the best runs of sweeps.

use super::prelude::*;
use isoflop::record::{ScoreRow, ScoredRun, read_scores, write_published};
use isoflop::scores::published::{self, EVALUATORS, Printed, Published};

#[derive(Args)]
pub struct PublishedArgs {
    /// Sweeps' folders with scores: adds the best run by FID of each generator
    pub results: Vec<PathBuf>,
    /// Only rows of this data set, e.g. HumanML3D
    #[arg(long)]
    pub dataset: Option<String>,
    /// The folder to write published.parquet and published.csv to
    #[arg(long)]
    pub out: Option<PathBuf>,
}

pub fn published(args: &PublishedArgs, output: &Output) -> Result<Exit> {
    let wanted = |row: &Published| {
        args.dataset.as_ref().is_none_or(|dataset| dataset.eq_ignore_ascii_case(row.dataset))
    };
    let mut rows: Vec<ScoreRow> =
        published::rows().iter().filter(|row| wanted(row)).map(ScoreRow::of_published).collect();
    for path in &args.results {
        let folder = ResultsFolder::new(path);
        let runs = read_scores(folder.root()).context("its scores; `isoflop run` writes them")?;
        rows.extend(best(&runs).map(|run| ScoreRow::of_run(&folder.name(), run)));
    }
    if let Some(out) = &args.out {
        write_published(out, &rows)?;
    }
    output.result(&json!({ "rows": rows, "sources": published::SOURCES }), &text(&rows))
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

/// One table per evaluator and data set.
fn text(rows: &[ScoreRow]) -> String {
    let groups = rows.chunk_by(|a, b| (&a.evaluator, &a.dataset) == (&b.evaluator, &b.dataset));
    let text: String = groups.map(of_group).collect();
    text + "\nscores by different evaluators are not comparable; sources: docs/published.md"
}

fn of_group(rows: &[ScoreRow]) -> String {
    let ScoreRow { evaluator, dataset, .. } = &rows[0];
    let about = EVALUATORS.iter().find(|(name, _)| name == evaluator).map_or_else(
        || format!("evaluator {evaluator}, trained by isoflop: not comparable with the rest"),
        |(_, about)| format!("evaluator: {about}"),
    );
    let row = |row: &ScoreRow| {
        let score = |name| row.scores.get(name).map(Printed::to_string).unwrap_or_default();
        let names = ["r_precision_1", "fid", "matching_distance", "multimodality"];
        let [first, fid, distance, multimodality] = names.map(score);
        [row.system.clone(), first, fid, distance, multimodality]
    };
    let heads = [&*format!("<{dataset}"), "<R@1", "<FID", "<MM-Dist", "<MultiModality"];
    format!("\n{about}\n{}", table(heads, rows.iter().map(row)))
}
