//! Scores of other systems, from papers: shown next to our own, not comparable with them.

use std::fmt;

use serde::Serialize;

/// The rows, as a table; `x±y` is a mean with the half of its 95 % interval.
const ROWS: &str = include_str!("published/rows.csv");

/// Each evaluator's name and description. Scores by different evaluators are not comparable.
pub const EVALUATORS: [(&str, &str); 3] = [
    ("guo", "matching networks of Guo et al. (2022), on 263 features (KIT-ML: 251)"),
    ("mardm", "MARDM's (Meng et al. 2024), on the first 67 features"),
    ("lg-tok", "LG-Tok's, whose row of MARDM on HumanML3D is that of `mardm`"),
];

/// Each source's name and description.
pub const SOURCES: [(&str, &str); 4] = [
    ("motion-anything", "Motion Anything (arXiv 2503.06955), supplementary material, Table 1"),
    ("vimorag", "VimoRAG (NeurIPS 2025), Table 7; codebooks of 512"),
    ("msflow", "MSFLOW (Yu and Fujiwara), Table 1; read by OCR, rows checked against other copies"),
    ("lg-tok", "LG-Tok (arXiv 2602.08337), abstract and project page; its tables were not at hand"),
];

/// A system on a data set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Published {
    pub system: &'static str,
    pub dataset: &'static str,
    /// One of [`EVALUATORS`].
    pub evaluator: &'static str,
    /// One of [`SOURCES`].
    pub source: &'static str,
    /// The printed scores by name.
    pub scores: Vec<(&'static str, Printed)>,
}

/// A score as it is printed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Printed {
    pub mean: f64,
    /// Half-width of the 95 % interval, if printed.
    pub half_width: Option<f64>,
}

impl fmt::Display for Printed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.half_width {
            None => write!(f, "{:.3}", self.mean),
            Some(half_width) => write!(f, "{:.3} ± {half_width:.3}", self.mean),
        }
    }
}

impl Published {
    /// A score by its name.
    pub fn score(&self, name: &str) -> Option<Printed> {
        self.scores.iter().find(|(own, _)| *own == name).map(|(_, score)| *score)
    }
}

/// The names of the scores, in the order of the table.
pub fn names() -> impl Iterator<Item = &'static str> {
    ROWS.lines().next().unwrap_or_default().split(',').skip(4)
}

/// All rows.
pub fn rows() -> Vec<Published> {
    ROWS.lines().skip(1).filter_map(row).collect()
}

fn row(line: &'static str) -> Option<Published> {
    let mut cells = line.split(',');
    let [system, dataset, evaluator, source] =
        [cells.next()?, cells.next()?, cells.next()?, cells.next()?];
    let scores = names().zip(cells).filter_map(|(name, cell)| Some((name, printed(cell)?)));
    Some(Published { system, dataset, evaluator, source, scores: scores.collect() })
}

fn printed(cell: &str) -> Option<Printed> {
    let (mean, half) = cell.split_once('±').map_or((cell, None), |(mean, half)| (mean, Some(half)));
    Some(Printed { mean: mean.parse().ok()?, half_width: half.and_then(|half| half.parse().ok()) })
}

// The page about scores of other systems.

const HEAD: &str = "\
<!-- Made from src/scores/published; written by
     ISOFLOP_BLESS=1 cargo test --release --test published_page -->

# Scores that papers print

Scores of other systems, to be named beside one's own. **Scores by different evaluators are not comparable**:
neither the tables below with one another, nor any of them with scores by an evaluator that isoflop trained
([evaluation.md](evaluation.md)). The weights of the evaluators behind these tables are bound to one data set
and one representation, and cannot be had everywhere.

`isoflop published results/NAME` prints them with the best runs of a sweep by FID beside them, each table
with its evaluator; `--out DIR` writes `published.parquet` and `published.csv`.

The numbers are copied as they are printed where they were read, mostly in tables of other papers than those
that measured them. Not among them, since no readable copy was at hand: Tables 2, 5 and 6 of ScaMo but for one
row, and Tables 2 and 3 of LG-Tok but for what its abstract and project page say.
";

/// The title of a column on the page.
fn heading(name: &str) -> &str {
    match name {
        "r_precision_1" => "R@1 ↑",
        "r_precision_2" => "R@2 ↑",
        "r_precision_3" => "R@3 ↑",
        "fid" => "FID ↓",
        "matching_distance" => "MM-Dist ↓",
        "diversity" => "Diversity →",
        "multimodality" => "MultiModality ↑",
        "cosine" => "CLIP-score ↑",
        other => other,
    }
}

/// The page, `docs/published.md`.
pub fn page() -> String {
    let all = rows();
    let mut text = HEAD.to_string();
    for (evaluator, about) in EVALUATORS {
        text += &format!("\n## Evaluator `{evaluator}`: {about}\n");
        let own: Vec<&Published> = all.iter().filter(|row| row.evaluator == evaluator).collect();
        let mut datasets: Vec<&str> = own.iter().map(|row| row.dataset).collect();
        datasets.dedup();
        for dataset in datasets {
            let of: Vec<&Published> =
                own.iter().filter(|row| row.dataset == dataset).copied().collect();
            text += &table(dataset, &of);
        }
    }
    text += "\n## Sources\n\n";
    text.extend(SOURCES.iter().map(|(name, about)| format!("- `{name}`: {about}.\n")));
    text
}

fn table(dataset: &str, rows: &[&Published]) -> String {
    let shown: Vec<&str> =
        names().filter(|name| rows.iter().any(|row| row.score(name).is_some())).collect();
    let headings: Vec<&str> = shown.iter().map(|name| heading(name)).collect();
    let mut text = format!("\n| {dataset} | {} | source |\n", headings.join(" | "));
    text += &format!("| --- |{} --- |\n", " --- |".repeat(shown.len()));
    for row in rows {
        let cells: Vec<String> = shown
            .iter()
            .map(|name| row.score(name).map(|score| score.to_string()).unwrap_or_default())
            .collect();
        text += &format!("| {} | {} | `{}` |\n", row.system, cells.join(" | "), row.source);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_cell_is_read_and_every_name_is_known() {
        let rows = rows();
        let cells = ROWS.lines().skip(1).flat_map(|line| line.split(',').skip(4));
        let written = cells.filter(|cell| !cell.is_empty()).count();
        assert_eq!(rows.iter().map(|row| row.scores.len()).sum::<usize>(), written);
        let columns = names().count() + 4;
        assert!(ROWS.lines().all(|line| line.split(',').count() == columns));
        let knows = |known: &[(&str, &str)], name| known.iter().any(|(own, _)| *own == name);
        assert!(rows.iter().all(|row| knows(&EVALUATORS, row.evaluator)));
        assert!(rows.iter().all(|row| knows(&SOURCES, row.source)));
        let keys: HashSet<_> =
            rows.iter().map(|row| (row.system, row.dataset, row.evaluator)).collect();
        assert_eq!(keys.len(), rows.len(), "none is there twice");
    }

    #[test]
    fn scores_are_what_they_can_be() {
        for row in rows() {
            let of = |name: &str| row.score(name).map(|score| score.mean);
            let precision = ["r_precision_1", "r_precision_2", "r_precision_3"].map(of);
            let shares: Vec<f64> = precision.into_iter().flatten().collect();
            assert!(shares.iter().all(|share| (0.0..1.0).contains(share)), "{row:?}");
            assert!(shares.is_sorted(), "{row:?}");
            assert!(of("fid").is_none_or(|fid| fid >= 0.0), "{row:?}");
        }
        let mardm = rows().into_iter().find(|row| row.system == "MARDM" && row.source == "msflow");
        let fid = mardm.and_then(|row| row.score("fid"));
        assert_eq!(fid, Some(Printed { mean: 0.114, half_width: Some(0.007) }));
    }
}
