//! Numbers that papers print, as tables: to be named beside one's own, not compared with them.
//!
//! A table is a CSV file beside this, so that adding a number is adding a row. Its first columns say what
//! a row is of, the others hold one metric each, as it is printed; `x±y` is a mean with the half of its 95 %
//! interval.

mod page;

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

pub use page::page;

/// Each evaluator's name, and what it is: what rows are scored by. Scores by different evaluators are not comparable.
pub const EVALUATORS: [(&str, &str); 2] = [
    ("guo", "matching networks of Guo et al. (2022), on 263 features (KIT-ML: 251)"),
    ("mardm", "MARDM's (Meng et al. 2024), on the first 67 features"),
];

/// Each source's name, with which the names of its tables begin, and where it was read.
pub const SOURCES: [(&str, &str); 4] = [
    (
        "scamo",
        "ScaMo: Exploring the Scaling Law in Autoregressive Motion Generation Model (CVPR 2025)",
    ),
    (
        "lg-tok",
        "Language-Guided Transformer Tokenizer for Human Motion Generation (arXiv 2602.08337)",
    ),
    ("motion-anything", "Motion Anything (arXiv 2503.06955), supplementary material, Table 1"),
    (
        "msflow",
        "MSFLOW (Yu and Fujiwara), Table 1; read by OCR; systems that `lg-tok-2` has are left out",
    ),
];

/// The scores of generated motions, in the order of the tables.
pub const SCORES: [&str; 8] = [
    "r_precision_1",
    "r_precision_2",
    "r_precision_3",
    "fid",
    "matching_distance",
    "diversity",
    "multimodality",
    "cosine",
];

/// A table of a paper.
#[derive(Debug)]
pub struct Table {
    /// `scamo-6`: its source and its number.
    pub name: &'static str,
    /// One of [`EVALUATORS`]; empty where nothing is scored by networks.
    pub evaluator: &'static str,
    /// The data set of rows that do not name theirs; empty where the paper's text names none.
    dataset: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// Columns, the first ones, that say what a row is of.
    keys: usize,
    /// Its file.
    pub csv: &'static str,
}

macro_rules! table {
    ($name:literal, $evaluator:literal, $dataset:literal, $keys:literal, $title:literal) => {
        Table {
            name: $name,
            evaluator: $evaluator,
            dataset: $dataset,
            title: $title,
            keys: $keys,
            csv: include_str!(concat!($name, ".csv")),
        }
    };
}

/// All tables.
pub static TABLES: [Table; 20] = [
    table!("motion-anything", "guo", "", 2, "systems by the first evaluator"),
    table!("scamo-6", "guo", "HumanML3D", 2, "seven codebooks by six models"),
    table!("scamo-6-rivals", "guo", "HumanML3D", 2, "the rows of language models"),
    table!("scamo-2", "guo", "HumanML3D", 2, "encoders of text"),
    table!("lg-tok-2", "mardm", "", 5, "systems by the second evaluator"),
    table!("msflow", "mardm", "", 2, "further systems by it"),
    table!("scamo-1", "", "", 1, "sizes of the models"),
    table!("scamo-5", "guo", "", 3, "VQ and FSQ by size of the codebook"),
    table!("scamo-7", "", "", 1, "parts of MotionUnion"),
    table!("scamo-8", "", "", 1, "levels of FSQ"),
    table!("scamo-laws", "", "", 2, "laws, Eqs. 10 to 14"),
    table!("lg-tok-1", "mardm", "Motion-X", 1, "numbers of tokens, without text"),
    table!("lg-tok-3", "mardm", "", 2, "reconstruction and generation"),
    table!("lg-tok-4", "mardm", "", 2, "choices, by LG-Tok-tiny: 3 layers, 5000 samples"),
    table!("lg-tok-5", "mardm", "", 2, "guidance of the detokenizer"),
    table!("lg-tok-6", "", "", 1, "batches of the contrastive evaluator"),
    table!("lg-tok-7", "mardm", "Motion-X", 2, "training without motions of other kinds"),
    table!("lg-tok-8", "mardm", "", 2, "language in decoding"),
    table!("lg-tok-9", "", "", 1, "inference times"),
    table!("lg-tok-perplexity", "", "", 2, "perplexity in §4.3: an exponential entropy"),
];

/// What one thing scores.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Of a published one [`Table::name`].
    pub table: String,
    pub dataset: String,
    /// Rows of different evaluators are not comparable.
    pub evaluator: String,
    pub system: String,
    /// What else it is of, as `quantizer VQ, codebook 256`.
    pub setting: String,
    /// By name.
    pub scores: BTreeMap<String, Printed>,
}

/// A number as it is printed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Printed {
    pub mean: f64,
    /// Of the 95 % interval, where one is printed.
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

impl Table {
    /// Its columns' names: those that say what a row is of, then those of metrics.
    pub fn columns(&self) -> [Vec<&'static str>; 2] {
        self.split(self.csv.lines().next().unwrap_or_default())
    }

    /// The cells of each row, as [`Table::columns`] has them.
    pub fn cells(&self) -> Vec<[Vec<&'static str>; 2]> {
        self.csv.lines().skip(1).map(|line| self.split(line)).collect()
    }

    fn split(&self, line: &'static str) -> [Vec<&'static str>; 2] {
        let mut keys: Vec<&str> = line.split(',').collect();
        let metrics = keys.split_off(self.keys);
        [keys, metrics]
    }

    /// Whether it scores generated motions.
    pub fn is_of_motions(&self) -> bool {
        self.columns()[1].contains(&SCORES[0])
    }

    /// Its rows with their numbers.
    pub fn rows(&self) -> Vec<Row> {
        let [keys, metrics] = self.columns();
        let row = |[own, cells]: [Vec<&str>; 2]| {
            let mut said: BTreeMap<&str, &str> = keys.iter().copied().zip(own.clone()).collect();
            let mut take = |name| said.remove(name);
            let dataset = take("dataset").unwrap_or(self.dataset).to_string();
            let system = take("system").or(take("model")).unwrap_or_default().to_string();
            let pairs = keys.iter().filter_map(|key| Some((key, said.get(key)?)));
            let setting: Vec<String> = pairs
                .filter(|(_, value)| !value.is_empty())
                .map(|(key, value)| format!("{key} {value}"))
                .collect();
            let scores = metrics.iter().zip(cells);
            let scores = scores.filter_map(|(name, cell)| Some((name.to_string(), printed(cell)?)));
            Row {
                table: self.name.to_string(),
                dataset,
                evaluator: self.evaluator.to_string(),
                system,
                setting: setting.join(", "),
                scores: scores.collect(),
            }
        };
        self.cells().into_iter().map(row).collect()
    }
}

/// The table of a name.
pub fn named(name: &str) -> Option<&'static Table> {
    TABLES.iter().find(|table| table.name == name)
}

/// The rows of all tables.
pub fn rows() -> Vec<Row> {
    TABLES.iter().flat_map(Table::rows).collect()
}

fn printed(cell: &str) -> Option<Printed> {
    let (mean, half) = cell.split_once('±').map_or((cell, None), |(mean, half)| (mean, Some(half)));
    Some(Printed { mean: mean.parse().ok()?, half_width: half.and_then(|half| half.parse().ok()) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_cell_is_a_number_and_every_row_another() {
        for table in &TABLES {
            let [keys, metrics] = table.columns();
            let cells: Vec<[Vec<&str>; 2]> = table.cells();
            let width = keys.len() + metrics.len();
            assert!(cells.iter().all(|[own, cells]| own.len() + cells.len() == width));
            let written = cells.iter().flat_map(|[_, cells]| cells).filter(|cell| !cell.is_empty());
            let read: usize = table.rows().iter().map(|row| row.scores.len()).sum();
            assert_eq!(read, written.count(), "{}", table.name);
            let own: HashSet<&Vec<&str>> = cells.iter().map(|[own, _]| own).collect();
            assert_eq!(own.len(), cells.len(), "{}", table.name);
            assert!(SOURCES.iter().any(|(name, _)| table.name.starts_with(name)));
            let knows = |(name, _): &(&str, &str)| *name == table.evaluator;
            assert!(table.evaluator.is_empty() || EVALUATORS.iter().any(knows));
        }
        let names: HashSet<&str> = TABLES.iter().map(|table| table.name).collect();
        assert_eq!(names.len(), TABLES.len());
    }

    #[test]
    fn scores_are_what_they_can_be() {
        for row in TABLES.iter().filter(|table| table.is_of_motions()).flat_map(Table::rows) {
            let of = |name: &str| row.scores.get(name).map(|score| score.mean);
            let shares: Vec<f64> = SCORES[..3].iter().copied().filter_map(of).collect();
            assert!(shares.iter().all(|share| (0.0..1.0).contains(share)), "{row:?}");
            assert!(shares.is_sorted(), "{row:?}");
            assert!(of("fid").is_none_or(|fid| fid >= 0.0), "{row:?}");
        }
    }

    #[test]
    fn a_row_says_what_it_is_of() {
        let rows = named("scamo-5").unwrap().rows();
        let row = rows.iter().find(|row| row.dataset == "MotionUnion").unwrap();
        assert_eq!((&*row.system, &*row.setting), ("", "quantizer VQ, codebook 256"));
        assert_eq!(row.scores["mpjpe_mm"], Printed { mean: 49.7, half_width: None });
        let rows = named("lg-tok-2").unwrap().rows();
        let row = rows.iter().find(|row| row.system == "MMM").unwrap();
        assert_eq!(row.setting, "source reported, venue CVPR' 24, tokens 49");
        let spread = Printed { mean: 1.241, half_width: Some(0.073) };
        assert_eq!(row.scores["multimodality"], spread);
    }
}
