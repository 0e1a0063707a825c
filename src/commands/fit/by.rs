//! `--by COLUMN`: the groups of a column, fitted side by side.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use isoflop::laws::FitError;
use isoflop::table::{Group, TableRequest};
use serde_json::{Map, Value, json};

use super::args::FitArgs;
use super::fitted::Fitted;
use super::table::RunTable;
use crate::commands::exit::{Exit, sentence};
use crate::commands::output::Output;

/// A group, and what came of fitting it.
struct Done {
    group: Group,
    runs: usize,
    fitted: Result<Fitted>,
}

/// Fits each group by its own rows; one that cannot be fitted says why and stops no other.
///
/// # Errors
/// Where no group can be fitted, the first one's error unless it is that of its runs.
pub fn fit(column: &str, request: &FitArgs, output: &Output) -> Result<Exit> {
    let table = RunTable::open(&request.source, request.flops)?;
    let groups = table.groups(&request.rows(), column)?;
    let files = request.out.as_deref().map(|folder| files(folder, &groups)).transpose()?;
    let each = groups.into_iter().map(|group| one(&table, group, request, output));
    let mut done: Vec<Done> = each.collect();
    let count = done.iter().filter(|one| one.fitted.is_ok()).count();
    if count == 0 && !done[0].fitted.as_ref().is_err_and(is_of_the_runs) {
        let first = done.swap_remove(0);
        let group = format!("{column} = {}", first.group.value);
        return first.fitted.map(|_| Exit::Done).context(group);
    }
    for (file, one) in files.iter().flatten().zip(&done) {
        one.fitted.as_ref().ok().map(|fitted| fitted.write(file)).transpose()?;
    }
    output.result(&document(column, &done), &text(&done))?;
    if count == 0 {
        output.warn(&format!("none of the {} groups could be fitted", done.len()));
        return Ok(Exit::NotIdentifiable);
    }
    Ok(Exit::Done)
}

fn is_of_the_runs(error: &anyhow::Error) -> bool {
    error.downcast_ref::<FitError>().is_some_and(FitError::is_unidentifiable)
}

fn one(table: &RunTable, group: Group, request: &FitArgs, output: &Output) -> Done {
    let own = TableRequest { group: Some(group.clone()), ..request.rows() };
    let mut source = match table.source(&own) {
        Ok(source) => source,
        Err(error) => return Done { group, runs: 0, fitted: Err(error) },
    };
    source.name = format!("{} {}", table.name, group.value);
    let told = source.rows.notes.iter().cloned().chain(source.lost());
    told.for_each(|line| output.note(&format!("{}: {line}", group.value)));
    let fitted = Fitted::of(&source, request, output);
    Done { group, runs: source.rows.points.len(), fitted }
}

fn document(column: &str, done: &[Done]) -> Value {
    let mut groups = Map::new();
    let mut failed = Map::new();
    for Done { group, fitted, .. } in done {
        match fitted {
            Ok(fitted) => groups.insert(group.value.clone(), fitted.document.clone()),
            Err(error) => failed.insert(group.value.clone(), json!(sentence(error))),
        };
    }
    json!({ "by": column, "groups": groups, "failed": failed })
}

/// One block a group, under its name.
fn text(done: &[Done]) -> String {
    let block = |Done { group, runs, fitted }: &Done| {
        let runs = if *runs > 0 { format!(", {runs} runs") } else { String::new() };
        let head = format!("{} = {}{runs}", group.column, group.value);
        let line = "-".repeat(head.chars().count().min(80));
        let body = match fitted {
            Ok(fitted) => fitted.text.clone(),
            Err(error) => format!("cannot be fitted: {}\n", sentence(error)),
        };
        format!("{head}\n{line}\n{body}")
    };
    done.iter().map(block).collect::<Vec<_>>().join("\n")
}

/// The file of each group in a folder.
///
/// # Errors
/// Where two groups would have one file.
fn files(folder: &Path, groups: &[Group]) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    let kept = |c: char| if c.is_alphanumeric() || "._-".contains(c) { c } else { '_' };
    let name = |group: &Group| group.value.chars().map(kept).collect::<String>();
    let names: Vec<String> = groups.iter().map(name).collect();
    let mut seen = HashSet::new();
    if let Some(twice) = names.iter().find(|name| !seen.insert(*name)) {
        bail!("two groups would be written to {twice}.json in {}", folder.display());
    }
    Ok(names.into_iter().map(|name| folder.join(name + ".json")).collect())
}
