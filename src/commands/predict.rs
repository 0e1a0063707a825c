//! `isoflop predict`: the optimal configuration for a budget.

use std::path::Path;

use anyhow::{Context, Result, bail};
use clap::Args;
use isoflop::files::{atomic, read_if_there};
use isoflop::jobs::ResultsFolder;
use isoflop::laws::{Laws, scamo};
use isoflop::predict::{self, CountedBy, PredictError, PredictOptions, Prediction};
use isoflop::spec::Ffn;
use isoflop::spec::ModelShape;
use isoflop::spec::flops::{TRAINING_PER_FORWARD, openai_per_token};

use super::args::budget;
use super::exit::Exit;
use super::output::Output;

#[derive(Args)]
pub struct PredictArgs {
    /// Budgets in FLOPs, as in 1e18
    #[arg(required = true, value_parser = budget)]
    pub budgets: Vec<f64>,
    /// A sweep's folder, a laws.json, or scamo for the published law
    #[arg(long, default_value = "scamo")]
    pub law: String,
    /// Distinct tokens to train on, where that is not the sweep's own data, as in 2e6
    #[arg(long, value_name = "U", value_parser = budget)]
    pub unique_tokens: Option<f64>,
}

pub fn predict(args: &PredictArgs, output: &Output) -> Result<Exit> {
    let own = laws_named(&args.law)?;
    let asked = args.unique_tokens.map(|unique| on_data(&own, unique)).transpose()?;
    let laws = asked.as_ref().unwrap_or(&own);
    let predictions = args
        .budgets
        .iter()
        .map(|budget| Ok(on_other_data(predict_one(laws, *budget)?, &own, args.unique_tokens)))
        .collect::<Result<Vec<Prediction>, PredictError>>()?;
    let text = predict::said(&predictions, output.full);
    output.result(&serde_json::to_value(&predictions)?, &text)?;
    Ok(Exit::Done)
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

/// The published law, or those of a sweep's folder or of a file.
pub fn laws_named(law: &str) -> Result<Laws> {
    if law == "scamo" { Ok(scamo()) } else { laws_of(Path::new(law)) }
}

/// The laws of a sweep's folder or of a file.
pub fn laws_of(path: &Path) -> Result<Laws> {
    let several = ResultsFolder::new(path).generators();
    if several.is_dir() && !path.join("laws.json").exists() {
        bail!(
            "{} has laws for each of its generators; name the folder of one in {}",
            path.display(),
            several.display()
        );
    }
    let path = if path.is_dir() { path.join("laws.json") } else { path.to_path_buf() };
    match read_if_there(&path)? {
        Some(laws) => Ok(laws),
        None => bail!(
            "{} does not exist; laws are those of a sweep's folder, a laws.json or scamo",
            path.display()
        ),
    }
}

/// Predicts with FLOPs counted by the rule that the laws are written in, where they can be.
pub fn predict_one(laws: &Laws, budget: f64) -> Result<Prediction, PredictError> {
    match (laws.flops_rule.as_str(), laws.n_ctx) {
        ("openai", Some(n_ctx)) => {
            let count = openai_count(n_ctx, laws.head_share.unwrap_or(1.0));
            let options = PredictOptions { flop_count: &count, ..PredictOptions::default() };
            predict::predict(laws, budget, &options)
        }
        _ => predict::predict(laws, budget, &PredictOptions::default()),
    }
}

/// Training FLOPs by ScaMo's Code 1 along the ladder of buildable shapes: what a token costs beside
/// its vocabulary is interpolated between rungs, in logarithms of N_nv; a code is chosen among
/// `head_share` of the vocabulary.
fn openai_count(n_ctx: usize, head_share: f64) -> CountedBy<impl Fn(f64, f64, f64) -> f64 + Sync> {
    let rungs: Vec<(f64, f64)> = predict::default_ladder()
        .iter()
        .map(|rung| {
            let shape = model_shape(rung, n_ctx);
            let flops = openai_per_token(&shape, 0) as f64;
            ((rung.params_nonvocab() as f64).ln(), flops.ln())
        })
        .collect();
    let count = move |nonvocab: f64, vocab: f64, tokens: f64| {
        let per_token = interpolate(&rungs, nonvocab.ln()).exp() + 2.0 * head_share * vocab;
        TRAINING_PER_FORWARD * per_token * tokens
    };
    CountedBy { rule: "openai".to_string(), count }
}

fn model_shape(rung: &predict::Shape, n_ctx: usize) -> ModelShape {
    ModelShape {
        n_layer: rung.n_layer as usize,
        n_head: rung.n_head as usize,
        d_model: rung.d_model as usize,
        d_ff: rung.d_ff as usize,
        n_ctx,
        d_text: 0,
        ffn: Ffn::SwiGlu,
        tie_embeddings: false,
        rope_base: 10_000.0,
    }
}

/// Linear between the two nearest of at least two rising points, and beyond the ends.
fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let above = points.partition_point(|(at, _)| *at < x).clamp(1, points.len() - 1);
    let ((x0, y0), (x1, y1)) = (points[above - 1], points[above]);
    y0 + (y1 - y0) * (x - x0) / (x1 - x0)
}

/// Predicts a sweep's own budgets into `prediction.json`; one that cannot be made is a warning.
pub fn write(
    folder: &ResultsFolder,
    laws: &Laws,
    budgets: &[f64],
    output: &Output,
) -> Result<Vec<Prediction>> {
    let mut predictions = Vec::new();
    for &budget in budgets {
        match predict_one(laws, budget) {
            Ok(prediction) => predictions.push(prediction),
            Err(error) => output.warn(&format!("no prediction for {budget:e} FLOPs: {error}")),
        }
    }
    let path = folder.file("prediction.json");
    atomic::write_json(&path, &predictions)
        .with_context(|| format!("writing {}", path.display()))?;
    Ok(predictions)
}
