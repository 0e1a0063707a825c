//! The page about numbers of papers, `docs/published.md`.

use super::{EVALUATORS, SOURCES, TABLES, Table, vocabulary};

const HEAD: &str = "\
<!-- Made from crates/model/src/scores/published; written by
     ISOFLOP_BLESS=1 cargo test --release --test published_page -->

# Numbers that papers print

All numbers that the tables of ScaMo and LG-Tok print, and scores of other systems: to be named beside one's own.
**Scores by different evaluators are not comparable**: neither those of two evaluators below with one another, nor
any of them with scores by an evaluator that isoflop trained ([evaluation.md](evaluation.md)). The weights of the
evaluators behind these tables are bound to one data set and one representation, and cannot be had everywhere.

`isoflop published results/NAME` prints scores of motions with the best runs of a sweep by FID beside them, each
table with its evaluator; `--table NAME` prints one table as CSV; `--out DIR` writes `published.parquet` and
`published.csv` with a line a number: `table`, `dataset`, `evaluator`, `system`, `setting`, `metric`, `value`,
`half_width` (of the 95 % interval, where one is printed).

Numbers are copied cell by cell as they are printed, with \"±\" where an interval is; they are facts, and no
sentence of a paper is copied. What a paper shows in figures alone, as the grid behind ScaMo's laws, is not here,
nor LG-Tok's Table 4g, whose columns the text at hand does not tell. ScaMo prints MPJPE in metres on HumanML3D and in
millimetres on MotionUnion.
";

/// What a column is called on the page.
fn heading(name: &str) -> String {
    let known = match name {
        "r_precision_1" => "R@1 ↑",
        "r_precision_2" => "R@2 ↑",
        "r_precision_3" => "R@3 ↑",
        "fid" => "FID ↓",
        "matching_distance" => "MM-Dist ↓",
        "diversity" => "Diversity →",
        "multimodality" => "MultiModality ↑",
        "cosine" => "CLIP-score ↑",
        "mpjpe_m" => "MPJPE, m",
        "mpjpe_mm" => "MPJPE, mm",
        other => return other.replace('_', " "),
    };
    known.to_string()
}

/// The page.
pub fn page() -> String {
    let mut text = HEAD.to_string();
    text.extend(TABLES.iter().map(section));
    text += &vocabulary::section();
    text += "\n## Evaluators\n\n";
    text.extend(EVALUATORS.iter().map(|(name, about)| format!("- `{name}`: {about}.\n")));
    text += "\n## Sources\n\n";
    text.extend(SOURCES.iter().map(|(name, about)| format!("- `{name}`: {about}.\n")));
    text
}

fn section(table: &Table) -> String {
    let mut text = format!("\n## `{}`: {}\n", table.name, table.title);
    if !table.evaluator.is_empty() {
        text += &format!("\nEvaluator `{}`.\n", table.evaluator);
    }
    let [keys, metrics] = table.columns();
    let names: Vec<&str> = keys.into_iter().chain(metrics).collect();
    let rows: Vec<Vec<&str>> = table.cells().iter().map(|row| row.concat()).collect();
    // Each data set has a table of its own, which leaves out what is not printed of it.
    if names[0] != "dataset" {
        return text + &lines(&names, &rows);
    }
    text.extend(rows.chunk_by(|a, b| a[0] == b[0]).map(|rows| lines(&names, rows)));
    text
}

/// A table of the columns that have a cell.
fn lines(names: &[&str], rows: &[Vec<&str>]) -> String {
    let shown = |column: &usize| rows.iter().any(|row| !row[*column].is_empty());
    let shown: Vec<usize> = (0..names.len()).filter(shown).collect();
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let heads = shown.iter().map(|column| heading(names[*column])).collect();
    let mut text = format!("\n{}|{}\n", line(heads), " --- |".repeat(shown.len()));
    let row = |row: &Vec<&str>| {
        line(shown.iter().map(|column| row[*column].replace('±', " ± ")).collect())
    };
    text.extend(rows.iter().map(row));
    text
}
