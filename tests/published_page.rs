//! `docs/published.md` is what the source holds of published numbers, and these are the papers'.

use std::path::Path;

use isoflop::scores::published::{self, SOURCES, TABLES, Table};

#[test]
fn the_page_about_published_numbers_is_what_the_source_holds() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/published.md");
    let page = published::page();
    if std::env::var_os("ISOFLOP_BLESS").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    let again = "ISOFLOP_BLESS=1 cargo test --release --test published_page";
    assert!(page == written, "docs/published.md is not what the source holds; write it: {again}");
}

/// The two papers of which every number is held.
const WHOLE: [&str; 2] = [SOURCES[0].0, SOURCES[1].0];

#[test]
fn every_number_of_both_papers_is_ours_and_ours_are_theirs() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/published");
    let Ok(files) = std::fs::read_dir(&folder) else {
        return println!("skipped: {} is not there", folder.display());
    };
    let mut met = Vec::new();
    for path in files.map(|file| file.expect("an entry").path()) {
        let stem = path.file_stem().expect("a name").to_string_lossy().into_owned();
        if path.extension().is_none_or(|end| end != "csv") {
            continue;
        }
        let name = stem.replace("lgtok", "lg-tok").replace("_table", "-").replace('_', "-");
        let table = published::named(&name).unwrap_or_else(|| panic!("{name} is not ours"));
        let theirs = theirs(&std::fs::read_to_string(&path).expect("text"));
        assert_eq!(ours(table), theirs, "{name}");
        met.push(table.name);
    }
    let whole = |table: &&Table| WHOLE.iter().any(|source| table.name.starts_with(source));
    let missing = TABLES.iter().filter(whole).find(|table| !met.contains(&table.name));
    assert!(missing.is_none(), "theirs lacks {missing:?}");
}

/// A row's cells by name, numbers as numbers are written; cells without anything are left out.
type Cells = Vec<(String, String)>;

fn cells(row: impl Iterator<Item = (String, String)>) -> Cells {
    let plain = |cell: String| cell.parse::<f64>().map_or(cell, |number| number.to_string());
    let mut cells: Cells = row
        .filter(|(_, cell)| !cell.is_empty() && cell != "-")
        .map(|(name, cell)| (name, plain(cell)))
        .collect();
    cells.sort();
    cells
}

fn ours(table: &Table) -> Vec<Cells> {
    let names = table.columns().concat();
    let row = |row: [Vec<&'static str>; 2]| {
        let of = |(name, cell): (&&str, &str)| {
            let (mean, half) = cell.split_once('±').unwrap_or((cell, ""));
            [(name.to_string(), mean.to_string()), (format!("{name}_ci95"), half.to_string())]
        };
        cells(names.iter().zip(row.concat()).flat_map(of))
    };
    table.cells().into_iter().map(row).collect()
}

/// Theirs, by our names: units stand in a name, and what a note holds has columns of its own.
fn theirs(text: &str) -> Vec<Cells> {
    let mut lines = text.lines().map(split);
    let names = lines.next().expect("a head");
    let scored = names.contains(&"diversity".to_string())
        || ["multimodality", "prefix"].iter().any(|name| names.contains(&name.to_string()));
    let row = |row: Vec<String>| {
        let dataset = row[0].clone();
        let of = |(name, cell): (&String, String)| match name.as_str() {
            "mpjpe" if dataset == "HumanML3D" => vec![("mpjpe_m".to_string(), cell)],
            "mpjpe" => vec![("mpjpe_mm".to_string(), cell)],
            "levels" => vec![(name.clone(), cell.trim_matches(['[', ']']).replace(',', " "))],
            "note" => cell.split(", ").filter_map(noted).collect(),
            _ if scored => vec![(score(name), cell)],
            _ => vec![(name.clone(), cell)],
        };
        cells(names.iter().zip(row).flat_map(of))
    };
    lines.map(row).collect()
}

/// `R2 0.95`.
fn noted(part: &str) -> Option<(String, String)> {
    let (name, number) = part.split_once(' ')?;
    Some((name.to_lowercase(), number.to_string()))
}

/// Our name of a score of generated motions.
fn score(name: &str) -> String {
    let (base, end) = name.strip_suffix("_ci95").map_or((name, ""), |base| (base, "_ci95"));
    let base = match base {
        "r1" => "r_precision_1",
        "r2" => "r_precision_2",
        "r3" => "r_precision_3",
        "mm_dist" | "matching_score" => "matching_distance",
        "clip_score" => "cosine",
        other => other,
    };
    format!("{base}{end}")
}

/// The cells of a line, of which one in quotes may hold commas.
fn split(line: &str) -> Vec<String> {
    let mut quoted = false;
    let is_end = |c: char| {
        quoted ^= c == '"';
        c == ',' && !quoted
    };
    line.split(is_end).map(|cell| cell.trim_matches('"').to_string()).collect()
}
