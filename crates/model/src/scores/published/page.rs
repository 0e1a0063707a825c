//! The page about numbers of papers, `docs/published.md`.

use super::{EVALUATORS, SOURCES, TABLES, Table, named};
use std::collections::BTreeMap;

const HEAD: &str = "\
<!-- Made from crates/model/src/scores/published; written by
     ISOFLOP_BLESS=1 cargo test --release --test published_page -->

# Numbers that papers print

All numbers that the tables of ScaMo and LG-Tok print, and scores of other systems: to be named beside one's own.
**Scores by different evaluators are not comparable**: neither those of two evaluators below with one another, nor
any of them with scores by an evaluator that isoflop trained ([evaluation.md](evaluation.md)). The weights of the
evaluators behind these tables are bound to one data set and one representation, and cannot be had everywhere; if you
have them, `evaluator: {weights: FOLDER}` scores your runs by the same ([evaluation.md](evaluation.md)).

`isoflop published results/NAME` prints scores of motions with the best runs of a sweep by FID beside them, each
table with its evaluator; `--table NAME` prints one table as CSV; `--out DIR` writes `published.parquet` and
`published.csv` with a line a number: `table`, `dataset`, `evaluator`, `system`, `setting`, `metric`, `value`,
`half_width` (of the 95 % interval, where one is printed).

Numbers are copied cell by cell as they are printed, with \"±\" where an interval is; they are facts, and no
sentence of a paper is copied. What a paper shows in figures alone, as the grid behind ScaMo's laws, is not here,
nor LG-Tok's Table 4g, whose columns the text at hand does not tell. ScaMo prints MPJPE in metres on HumanML3D and in
millimetres on MotionUnion. What LG-Tok calls perplexity is `likeliest_exponential_entropy` of our records:
[tokenizers.md](tokenizers.md#transformers-and-language) has one of ours beside theirs.
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
    text += &codebooks_that_pay();
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

// ScaMo's Table 6, read: from which size of the model on a larger vocabulary pays.

/// The scores of its cells, the better the larger, by codebook and model; models are in the order of their sizes.
struct Grid {
    models: Vec<String>,
    /// A row of models a codebook.
    cells: BTreeMap<usize, Vec<f64>>,
}

impl Grid {
    /// The grid of a score, of which `sign` times the printed number is the better the larger.
    fn of(score: &str, sign: f64) -> Self {
        let (mut models, mut cells) = (Vec::new(), BTreeMap::<usize, Vec<f64>>::new());
        for row in named("scamo-6").iter().flat_map(|table| table.rows()) {
            let codebook = row.setting.rsplit(' ').next().and_then(|n| n.parse().ok());
            let value = row.scores.get(score).map_or(f64::NAN, |printed| sign * printed.mean);
            cells.entry(codebook.unwrap_or(0)).or_default().push(value);
            if !models.contains(&row.system) {
                models.push(row.system);
            }
        }
        Self { models, cells }
    }

    /// The codebook that is best at a model.
    fn best(&self, model: usize) -> usize {
        let best = self.cells.iter().max_by(|a, b| a.1[model].total_cmp(&b.1[model]));
        best.map_or(0, |(codebook, _)| *codebook)
    }

    /// The smallest model at which a codebook is better than another, and no worse at any larger model.
    fn pays_from(&self, codebook: usize, other: usize) -> &str {
        let (own, other) = (&self.cells[&codebook], &self.cells[&other]);
        let no_worse = (0..own.len()).rev().take_while(|model| own[*model] >= other[*model]);
        let from = no_worse.filter(|model| own[*model] > other[*model]).last();
        from.map_or("none", |model| &self.models[model])
    }
}

/// The section of the page.
fn codebooks_that_pay() -> String {
    let [fid, found] = [Grid::of("fid", -1.0), Grid::of("r_precision_1", 1.0)];
    let mut text = "\n## When does a larger vocabulary pay?\n\n\
        Computed from `scamo-6`, one run a cell and no intervals. The codebook that is best at each size of the \
        model:\n\n| model | V by FID | V by R@1 |\n| --- | --- | --- |\n"
        .to_string();
    for (model, name) in fid.models.iter().enumerate() {
        text += &format!("| {name} | {} | {} |\n", fid.best(model), found.best(model));
    }
    text += "\nThe smallest model at which V codes are better than fewer, and no worse at any larger model:\n\n\
        | V | than the fewest, by FID | by R@1 | than the next fewer, by FID | by R@1 |\n\
        | --- | --- | --- | --- | --- |\n";
    let codebooks: Vec<usize> = fid.cells.keys().copied().collect();
    for pair in codebooks.windows(2) {
        let (fewer, own) = (pair[0], pair[1]);
        let than = |other| [&fid, &found].map(|grid| grid.pays_from(own, other));
        let cells = [than(codebooks[0]), than(fewer)].concat().join(" | ");
        text += &format!("| {own} | {cells} |\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_models_want_few_codes_and_large_ones_many() {
        let grids = [Grid::of("fid", -1.0), Grid::of("r_precision_1", 1.0)];
        for grid in grids {
            assert_eq!(grid.models, ["44M", "111M", "343M", "775M", "1B", "3B"]);
            let best: Vec<usize> = (0..6).map(|model| grid.best(model)).collect();
            assert_eq!(best, [256, 256, 65536, 65536, 65536, 65536]);
            assert_eq!(grid.pays_from(65536, 256), "343M");
            assert_eq!(grid.pays_from(16384, 4096), "none");
        }
    }
}
