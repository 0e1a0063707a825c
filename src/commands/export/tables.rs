//! Tables of a sweep, each a file.

use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};
use isoflop::files::{atomic, read_if_there};
use isoflop::laws::{Laws, Minimum};

use super::exporter::Exporter;

/// `runs.csv`, `scores.csv` where runs are scored, and `minima.csv` where there are laws.
pub fn csv(exporter: &Exporter) -> Result<Vec<PathBuf>> {
    exporter.needs(&["runs.csv"])?;
    let mut paths = copied(exporter, "csv")?;
    let laws: Option<Laws> = read_if_there(&exporter.folder.file("laws.json"))?;
    if let Some(laws) = laws {
        let path = exporter.out.join("minima.csv");
        atomic::write_bytes(&path, minima(&laws).as_bytes())?;
        paths.push(path);
    }
    Ok(paths)
}

/// `runs.parquet`, and `scores.parquet` where runs are scored.
pub fn parquet(exporter: &Exporter) -> Result<Vec<PathBuf>> {
    exporter.needs(&["runs.parquet"])?;
    copied(exporter, "parquet")
}

fn copied(exporter: &Exporter, ending: &str) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for name in ["runs", "scores"].map(|name| format!("{name}.{ending}")) {
        let from = exporter.folder.file(&name);
        if from.exists() {
            let bytes = fs::read(&from).with_context(|| format!("reading {}", from.display()))?;
            let path = exporter.out.join(&name);
            atomic::write_bytes(&path, &bytes)?;
            paths.push(path);
        }
    }
    Ok(paths)
}

/// A row a minimum, of every method.
fn minima(laws: &Laws) -> String {
    let mut text = String::from(
        "method,budget_flops,params_nonvocab,params_vocab,n_vocab,tokens,loss_normalised,trusted,flags\n",
    );
    for minimum in &laws.minima {
        let Minimum { budget_flops, params_nonvocab, params_vocab, n_vocab, tokens, .. } = minimum;
        let method = serde_json::to_value(minimum.method).unwrap_or_default();
        let _ = writeln!(
            text,
            "{},{budget_flops:?},{params_nonvocab:?},{params_vocab:?},{n_vocab:?},{tokens:?},{:?},{},{}",
            method.as_str().unwrap_or_default(),
            minimum.loss_normalised,
            minimum.trusted,
            flags(minimum)
        );
    }
    text
}

/// Their words, with blanks between.
fn flags(minimum: &Minimum) -> String {
    let flags = serde_json::to_value(&minimum.flags).unwrap_or_default();
    let words = flags.as_array().into_iter().flatten().filter_map(|flag| flag.as_str());
    words.collect::<Vec<_>>().join(" ")
}
