//! The page about scores of other systems.

use super::{EVALUATORS, Published, SOURCES, names, rows};

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

/// What a column is called on the page.
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
