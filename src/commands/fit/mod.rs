//! `isoflop fit`: laws from a sweep, or from any table of runs.

mod args;
mod next;
mod source;
mod sweep;

pub use args::{FitArgs, TableArgs};
pub use source::{TableStudy, beside};
pub use sweep::{fit_records, options, points};

use super::output::say;
use super::predict::each;
use super::prelude::*;
use isoflop::laws::{FitError, LawKind};
use isoflop::table::{self, Group, TableRequest};
use isoflop::words::fit::{brief, summary};
use isoflop::words::prediction::said;
use serde_json::Map;
use source::{RunTable, Source, laws};
use std::collections::HashSet;
use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

pub fn fit(args: &FitArgs, output: &Output) -> Result<Exit> {
    let request = args.resolved();
    if let Some(column) = &args.by {
        return fit_fitted(column, &request, output);
    }
    let source = source::open(&args.source, &request)?;
    source.told().for_each(|line| output.note(&line));
    let fitted = Fitted::of(&source, &request, output)?;
    if let (Some(path), Some(own)) = (&args.next, &source.sweep) {
        next::write(path, own, &fitted.laws)?;
        output.note(&format!("what to run next is {}", path.display()));
    } else if args.next.is_some() {
        bail!("--next wants a sweep's folder: nothing is known of how {} was made", source.name);
    }
    // A sweep's folder has its own laws; other laws are written next to them.
    let own = source.sweep.as_ref().map(|own| match fitted.laws.law {
        LawKind::Isoflop | LawKind::Published => own.folder.file("laws.json"),
        other => own.folder.file(format!("laws-{}.json", other.name())),
    });
    if let Some(path) = args.out.clone().or_else(|| own.filter(|_| args.save)) {
        atomic::write_json(&path, &fitted.laws)?;
    }
    output.result(&fitted.document, &fitted.text)?;
    let undetermined = fitted.laws.answer().exponents.is_undetermined();
    Ok(if undetermined { Exit::NotIdentifiable } else { Exit::Done })
}

/// The output of a fit.
struct Fitted {
    pub laws: Laws,
    pub document: Value,
    pub text: String,
}

impl Fitted {
    pub fn of(source: &Source, request: &FitArgs, output: &Output) -> Result<Self> {
        let runs = source.rows.points.len();
        let line = format!("fitting {runs} runs of {} and their bootstrap …", source.name);
        let _waits = said_if_slow(output, line);
        let mut laws = laws(source, request)?;
        if let Some(own) = &source.sweep {
            laws.judgement.validations = own.folder.validations(|line| output.warn(&line));
            if !laws.judgement.validations.is_empty() {
                laws = laws.answered();
            }
        }
        request.raw_note(&source.rows.points).iter().for_each(|note| output.note(note));
        // A sweep has its own list, for `isoflop predict`.
        let budgets = source.rows.points.iter().map(|point| point.budget_flops);
        let largest = budgets.reduce(f64::max).filter(|_| source.sweep.is_none());
        let predictions = each(&laws, &request.budgets(largest), output);
        Ok(Self {
            document: document(&laws, &predictions, source)?,
            text: text(&laws, &predictions, output.full),
            laws,
        })
    }
}

/// The contents of `laws.json`, with the requested optima and the notes on a table's rows.
fn document(laws: &Laws, predictions: &[Prediction], source: &Source) -> Result<Value> {
    let mut document = serde_json::to_value(laws)?;
    document["verdict"] = json!(brief(laws));
    if source.sweep.is_none() {
        document["dropped"] = json!(source.rows.dropped);
        document["notes"] = json!(source.rows.notes);
    }
    if !predictions.is_empty() {
        document["predictions"] = serde_json::to_value(predictions)?;
    }
    Ok(document)
}

/// The laws and the requested optima: in full, or one screen.
pub fn text(laws: &Laws, predictions: &[Prediction], full: bool) -> String {
    let own = if full { summary(laws) } else { brief(laws) };
    if predictions.is_empty() { own } else { format!("{own}\n{}", said(predictions, full)) }
}

// A line on a terminal if a fit takes long.

/// Time before the line is shown.
const PATIENCE: Duration = Duration::from_secs(2);

/// Prints `line` on a terminal's standard error, if notes are wanted and the returned guard still lives after two
/// seconds. Dropping the guard ends the thread.
fn said_if_slow(output: &Output, line: String) -> Option<Sender<()>> {
    let wanted = !output.quiet && std::io::stderr().is_terminal();
    wanted.then(|| said_after(PATIENCE, move || say(&line)))
}

/// Calls `then` after a time, unless the returned guard is dropped before.
fn said_after(time: Duration, then: impl FnOnce() + Send + 'static) -> Sender<()> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        if receiver.recv_timeout(time) == Err(RecvTimeoutError::Timeout) {
            then();
        }
    });
    sender
}

// `--by COLUMN`: fits the groups of a column separately.

/// A group, and the result of its fit.
struct Done {
    group: Group,
    runs: usize,
    fitted: Result<Fitted>,
}

/// Fits each group by its own rows; a group that cannot be fitted gives its reason, and the others go on.
///
/// # Errors
/// No group can be fitted: the error of the first, unless it is about its runs.
fn fit_fitted(column: &str, request: &FitArgs, output: &Output) -> Result<Exit> {
    let table = RunTable::open(&request.source, request.flops)?;
    let groups = table::groups(&table.table, &request.rows(), column)?;
    let files = request.out.as_deref().map(|folder| files(folder, &groups)).transpose()?;
    let each = groups.into_iter().map(|group| one(&table, group, request, output));
    let mut done: Vec<Done> = each.collect();
    let count = done.iter().filter(|one| one.fitted.is_ok()).count();
    let is_of_the_runs =
        |error: &anyhow::Error| error.downcast_ref().is_some_and(FitError::is_unidentifiable);
    if count == 0 && !done[0].fitted.as_ref().is_err_and(is_of_the_runs) {
        let first = done.swap_remove(0);
        let group = format!("{column} = {}", first.group.value);
        return first.fitted.map(|_| Exit::Done).context(group);
    }
    for (file, one) in files.iter().flatten().zip(&done) {
        if let Ok(fitted) = &one.fitted {
            atomic::write_json(file, &fitted.laws)?;
        }
    }
    output.result(&document_by(column, &done), &text_by(&done))?;
    if count == 0 {
        output.warn(&format!("none of the {} groups could be fitted", done.len()));
        return Ok(Exit::NotIdentifiable);
    }
    Ok(Exit::Done)
}

fn one(table: &RunTable, group: Group, request: &FitArgs, output: &Output) -> Done {
    let own = TableRequest { group: Some(group.clone()), ..request.rows() };
    let mut source = match table.source(&own) {
        Ok(source) => source,
        Err(error) => return Done { group, runs: 0, fitted: Err(error) },
    };
    source.name = format!("{} {}", table.name, group.value);
    source.told().for_each(|line| output.note(&format!("{}: {line}", group.value)));
    let fitted = Fitted::of(&source, request, output);
    Done { group, runs: source.rows.points.len(), fitted }
}

fn document_by(column: &str, done: &[Done]) -> Value {
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

/// One block per group, under its name.
fn text_by(done: &[Done]) -> String {
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
/// Two groups would have the same file.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_said_after_a_while_and_not_if_all_is_done_before() {
        let (tell, told) = channel();
        let quick = tell.clone();
        drop(said_after(Duration::from_millis(200), move || quick.send("quick").unwrap()));
        let kept = said_after(Duration::from_millis(1), move || tell.send("slow").unwrap());
        assert_eq!(told.recv_timeout(Duration::from_secs(10)), Ok("slow"));
        drop(kept);
        assert_eq!(
            told.recv_timeout(Duration::from_millis(400)),
            Err(RecvTimeoutError::Disconnected)
        );
    }
}
