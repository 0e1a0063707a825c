//! What a folder of results keeps, for its page.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Result;
use isoflop::files::{read_if_there, read_text_if_there};
use isoflop::jobs::ResultsFolder;
use isoflop::report::Figure;
use serde_json::Value;

/// The figures of a folder, by name; none where there is no folder.
pub fn figures(folder: &Path) -> Result<Vec<Figure>> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let is_drawing = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "svg");
    let paths: BTreeSet<PathBuf> = entries.map(|entry| entry.path()).filter(is_drawing).collect();
    let read = |path: &PathBuf| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Figure { name, svg: text(path)? })
    };
    paths.iter().map(read).collect()
}

/// A file's text; empty where there is none.
pub fn text(path: &Path) -> Result<String> {
    Ok(read_text_if_there(path)?.unwrap_or_default())
}

/// The cells that were not run, each in a line; none where no plan is kept.
pub fn dropped(folder: &ResultsFolder) -> Result<Vec<String>> {
    let plan: Option<Value> = read_if_there(&folder.file("plan.json"))?;
    let cells = plan.as_ref().and_then(|plan| plan["dropped"].as_array());
    Ok(cells.into_iter().flatten().map(dropped_line).collect())
}

fn dropped_line(cell: &Value) -> String {
    let reason = cell["reason"].as_str().unwrap_or_default();
    let facts = cell.as_object().into_iter().flatten();
    let facts = facts.filter(|(key, value)| *key != "reason" && !value.is_null());
    let facts: Vec<String> = facts.map(|(key, value)| format!("{key} {value}")).collect();
    format!("{}: {reason}", facts.join(", "))
}
