//! [`Fitted`]: what a fit prints and keeps.

use std::path::Path;

use anyhow::Result;
use isoflop::files::atomic;
use isoflop::laws::Laws;
use isoflop::predict::Prediction;
use isoflop::words::fit::{brief, summary};
use isoflop::words::prediction::said;
use serde_json::{Value, json};

use super::args::FitArgs;
use super::laws::laws;
use super::slow::Slow;
use super::source::Source;
use crate::commands::output::Output;
use crate::commands::predict::each;
use crate::commands::validate::gathered;

/// What a fit prints and keeps.
pub struct Fitted {
    pub laws: Laws,
    pub document: Value,
    pub text: String,
}

impl Fitted {
    pub fn of(source: &Source, request: &FitArgs, output: &Output) -> Result<Self> {
        let runs = source.rows.points.len();
        let line = format!("fitting {runs} runs of {} and their bootstrap …", source.name);
        let _slow = Slow::watch(output, line);
        let mut laws = laws(source, request)?;
        if let Some(own) = &source.sweep {
            laws.judgement.validations = gathered(&own.folder, output);
            if !laws.judgement.validations.is_empty() {
                laws = laws.answered();
            }
        }
        request.raw_note(&source.rows.points).iter().for_each(|note| output.note(note));
        let predictions = predictions(&laws, source, request, output);
        Ok(Self {
            document: document(&laws, &predictions, source)?,
            text: text(&laws, &predictions, output.full),
            laws,
        })
    }

    pub fn write(&self, path: &Path) -> Result<()> {
        Ok(atomic::write_json(path, &self.laws)?)
    }
}

/// The optimum of each budget asked for; one that the laws cannot give is a warning.
fn predictions(
    laws: &Laws,
    source: &Source,
    request: &FitArgs,
    output: &Output,
) -> Vec<Prediction> {
    // A sweep has a list of its own, for `isoflop predict`.
    let budgets = source.rows.points.iter().map(|point| point.budget_flops);
    let largest = budgets.reduce(f64::max).filter(|_| source.sweep.is_none());
    each(laws, &request.budgets(largest), output)
}

/// What `laws.json` holds; beside it the optima asked for, and what became of a table's rows.
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

/// The laws and the optima asked for: everything, or one screen.
pub fn text(laws: &Laws, predictions: &[Prediction], full: bool) -> String {
    let own = if full { summary(laws) } else { brief(laws) };
    let optima = (!predictions.is_empty()).then(|| said(predictions, full));
    [own].into_iter().chain(optima).collect::<Vec<_>>().join("\n")
}
