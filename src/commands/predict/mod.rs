//! `isoflop predict`: the optimal configuration for a budget, and the loss of a given model.

mod count;
mod law;
mod sized;

use anyhow::{Context, Result};
use clap::Args;
use isoflop::files::atomic;
use isoflop::jobs::ResultsFolder;
use isoflop::laws::Laws;
use isoflop::predict::{self, FlopCount, PredictError, PredictOptions, Prediction};
use isoflop::words::prediction::said;

use super::args::budget;
use super::exit::Exit;
use super::output::Output;
pub use count::openai_blocks;
use count::openai_count;
use sized::SizedArgs;

pub use law::{laws_named, laws_of, not_of_groups};

/// Shown below the options.
const EXAMPLES: &str = "\
Examples:
  The optimum for two budgets by a sweep's laws, and by the published one
    isoflop predict 1e14,1e15 --law results/NAME
    isoflop predict 1e18 --law scamo

  The loss of a model trained on more tokens than the optimum, by a table's law
    isoflop fit runs.csv --law approach3 --out laws.json
    isoflop predict --params 7e9 --tokens 15e12 --law laws.json";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct PredictArgs {
    /// Budgets in FLOPs, as in 1e18 or 1e18,1e19
    #[arg(
        required_unless_present = "params",
        conflicts_with = "params",
        value_parser = budget,
        value_delimiter = ',',
        value_name = "BUDGET"
    )]
    pub budgets: Vec<f64>,
    /// A sweep's folder, a laws.json, or scamo for the published law
    #[arg(long, value_name = "RESULTS|FILE|scamo")]
    pub law: Option<String>,
    /// Distinct tokens to train on, where that is not the sweep's own data, as in 2e6
    #[arg(long, value_name = "U", value_parser = budget)]
    pub unique_tokens: Option<f64>,
    #[command(flatten)]
    sized: SizedArgs,
}

pub fn predict(args: &PredictArgs, output: &Output) -> Result<Exit> {
    let own = laws_named(args.law.as_deref().ok_or_else(law::missing)?)?;
    let asked = args.unique_tokens.map(|unique| on_data(&own, unique)).transpose()?;
    let laws = asked.as_ref().unwrap_or(&own);
    if let Some(model) = args.sized.model() {
        return sized::predict(laws, &model, output);
    }
    let predictions = args
        .budgets
        .iter()
        .map(|budget| Ok(on_other_data(predict_one(laws, *budget)?, &own, args.unique_tokens)))
        .collect::<Result<Vec<Prediction>, PredictError>>()?;
    let text = said(&predictions, output.full);
    output.result(&serde_json::to_value(&predictions)?, &text)
}

/// The laws where other data is at hand.
fn on_data(laws: &Laws, unique_tokens: f64) -> Result<Laws> {
    laws.on_data(unique_tokens).with_context(|| {
        format!(
            "--unique-tokens asks what more data would be worth, which the laws of {} do not tell: it takes a \
             sweep whose runs repeat their data, and shares of it tell it best (grid.shares)",
            laws.name
        )
    })
}

/// The prediction, with a sentence where it is of other data than the sweep's.
fn on_other_data(mut said: Prediction, own: &Laws, unique_tokens: Option<f64>) -> Prediction {
    let tried = own.judgement.tried.and_then(|tried| tried.unique_tokens);
    if let (Some(asked), Some(tried)) = (unique_tokens, tried) {
        let sentence = format!(
            "{asked:.3e} distinct tokens are asked for; the sweep had {tried:.3e}, and its test split is of its own \
             data."
        );
        said.warnings.insert(0, sentence);
    }
    said
}

/// Predicts with FLOPs counted by the rule that the laws are written in, where they can be.
pub fn predict_one(laws: &Laws, budget: f64) -> Result<Prediction, PredictError> {
    let shapes = predict::ladder_of(laws);
    let options = PredictOptions { shapes: &shapes, ..PredictOptions::default() };
    match (laws.flops_rule.as_str(), laws.n_ctx) {
        ("openai", Some(n_ctx)) => {
            let count = openai_count(n_ctx, laws.head_share.unwrap_or(1.0), &shapes);
            let flop_count = FlopCount { rule: "openai", flops: &count };
            predict::predict(laws, budget, &PredictOptions { flop_count, ..options })
        }
        _ => predict::predict(laws, budget, &options),
    }
}

/// Predicts each budget; one that the laws cannot predict is a warning.
pub fn each(laws: &Laws, budgets: &[f64], output: &Output) -> Vec<Prediction> {
    let predicted = |budget: &f64| {
        let failed = |error: &PredictError| {
            output.warn(&format!("no prediction for {budget:e} FLOPs: {error}"));
        };
        predict_one(laws, *budget).inspect_err(failed).ok()
    };
    budgets.iter().filter_map(predicted).collect()
}

/// Predicts a sweep's own budgets into `prediction.json`.
pub fn write(
    folder: &ResultsFolder,
    laws: &Laws,
    budgets: &[f64],
    output: &Output,
) -> Result<Vec<Prediction>> {
    let predictions = each(laws, budgets, output);
    atomic::write_json(&folder.file("prediction.json"), &predictions)?;
    Ok(predictions)
}
