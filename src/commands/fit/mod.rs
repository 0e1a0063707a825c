//! `isoflop fit`: laws from a sweep, or from any table of runs.

mod args;
mod laws;
mod next;
mod request;
mod source;
mod sweep;
mod tao;

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use isoflop::files::atomic;
use isoflop::laws::{LawKind, Laws, brief, summary};
use isoflop::predict::{self, Prediction};
use serde_json::{Value, json};

use super::exit::Exit;
use super::output::Output;
use super::predict::predict_one;
use super::validate::gathered;
use request::FitRequest;
use source::Source;

pub use args::FitArgs;
pub use sweep::{fit_records, options, points};

pub fn fit(args: &FitArgs, output: &Output) -> Result<Exit> {
    let request = FitRequest::of(args)?;
    let source = Source::open(&args.source, &request)?;
    tell(&source, output);
    if request.compat == Some(args::CompatName::Tao) {
        return fit_as_tao(&source, &request, args, output);
    }
    let mut laws = laws::laws(&source, &request)?;
    if let Some(own) = &source.sweep {
        laws.judgement.validations = gathered(&own.folder, output);
        if !laws.judgement.validations.is_empty() {
            laws = laws.answered();
        }
    }
    if let Some(path) = &args.next {
        let Some(own) = &source.sweep else {
            bail!(
                "--next wants a sweep's folder: nothing is known of how {} was made",
                source.name
            );
        };
        next::write(path, own, &laws)?;
        output.note(&format!("what to run next is {}", path.display()));
    }
    let predictions = predictions(&laws, &source, &request, output);
    if let Some(path) = args.out.clone().or_else(|| own_file(&source, &laws).filter(|_| args.save))
    {
        atomic::write_json(&path, &laws).with_context(|| format!("writing {}", path.display()))?;
    }
    output.result(
        &document(&laws, &predictions, &source)?,
        &text(&laws, &predictions, output.full),
    )?;
    Ok(if laws.answer().exponents.is_undetermined() { Exit::NotIdentifiable } else { Exit::Done })
}

fn fit_as_tao(
    source: &Source,
    request: &FitRequest,
    args: &FitArgs,
    output: &Output,
) -> Result<Exit> {
    let tao = tao::Tao::fit(source, request)?;
    let document = tao.document()?;
    if let Some(path) = &args.out {
        atomic::write_json(path, &document)
            .with_context(|| format!("writing {}", path.display()))?;
    }
    output.result(&document, &tao.text())?;
    Ok(Exit::Done)
}

/// What became of rows, and what was taken without being asked.
fn tell(source: &Source, output: &Output) {
    source.notes.iter().for_each(|line| output.note(line));
    for row in &source.dropped {
        output.note(&format!("dropped {} ({}): {}", row.run_id, row.stage, row.reason));
    }
}

/// A sweep's folder holds its own laws; those of another law stand beside them.
fn own_file(source: &Source, laws: &Laws) -> Option<PathBuf> {
    let folder = &source.sweep.as_ref()?.folder;
    Some(match laws.law {
        LawKind::Isoflop | LawKind::Published => folder.file("laws.json"),
        other => folder.file(format!("laws-{}.json", other.name())),
    })
}

/// The optimum of each budget asked for; one that the laws cannot give is a warning.
fn predictions(
    laws: &Laws,
    source: &Source,
    request: &FitRequest,
    output: &Output,
) -> Vec<Prediction> {
    // A sweep has a list of its own, for `isoflop predict`.
    let budgets = source.points.iter().map(|point| point.budget_flops);
    let largest = budgets.reduce(f64::max).filter(|_| source.sweep.is_none());
    let predicted = |budget| match predict_one(laws, budget) {
        Ok(prediction) => Some(prediction),
        Err(error) => {
            output.warn(&format!("no optimum for {budget:e} FLOPs: {error}"));
            None
        }
    };
    request.budgets(largest).into_iter().filter_map(predicted).collect()
}

/// What `laws.json` holds; beside it the optima asked for, and what became of a table's rows.
fn document(laws: &Laws, predictions: &[Prediction], source: &Source) -> Result<Value> {
    let mut document = serde_json::to_value(laws)?;
    document["verdict"] = json!(brief(laws));
    if source.sweep.is_none() {
        document["dropped"] = json!(source.dropped);
        document["notes"] = json!(source.notes);
    }
    if !predictions.is_empty() {
        document["predictions"] = serde_json::to_value(predictions)?;
    }
    Ok(document)
}

/// The laws and the optima asked for: everything, or one screen.
pub fn text(laws: &Laws, predictions: &[Prediction], full: bool) -> String {
    let own = if full { summary(laws) } else { brief(laws) };
    let optima = (!predictions.is_empty()).then(|| predict::said(predictions, full));
    [own].into_iter().chain(optima).collect::<Vec<_>>().join("\n")
}
