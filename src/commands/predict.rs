//! `isoflop predict`: the optimal configuration for a budget, and the loss of a given model.

use super::args::budget;
use super::prelude::*;
use isoflop::laws::text::count;
use isoflop::laws::{Doubt, scamo};
use isoflop::predict::{self, FlopCount, ModelSize, PredictError, PredictOptions, predict_sized};
use isoflop::spec::flops::{TRAINING_PER_FORWARD, openai_per_token};
use isoflop::spec::{Ffn, ModelShape};
use isoflop::table::number;
use isoflop::words::prediction::{said, sized_text};

/// Shown below the options.
const EXAMPLES: &str = "\
Examples:
  The optimum for two budgets by a sweep's laws, and for one by the published law
    isoflop predict 1e14,1e15 --law results/NAME
    isoflop predict 1e18 --law scamo

  The loss of a model trained on more tokens than the optimum, by a table's law
    isoflop fit runs.csv --law approach3 --out laws.json
    isoflop predict --params 7e9 --tokens 15e12 --law laws.json";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct PredictArgs {
    /// Budgets in FLOPs, e.g. 1e18 or 1e18,1e19
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
    /// Distinct tokens to train on, if not those of the sweep's data, e.g. 2e6
    #[arg(long, value_name = "U", value_parser = budget)]
    pub unique_tokens: Option<f64>,
    #[command(flatten)]
    sized: SizedArgs,
}

pub fn predict(args: &PredictArgs, output: &Output) -> Result<Exit> {
    let own = laws_named(args.law.as_deref().ok_or_else(missing)?)?;
    let on_data = |unique: f64| {
        own.on_data(unique).with_context(|| {
            format!(
                "--unique-tokens asks what more data would be worth, which the laws of {} do not tell: it takes \
                 a sweep whose runs repeat their data, and shares of it tell it best (grid.shares)",
                own.name
            )
        })
    };
    let asked = args.unique_tokens.map(on_data).transpose()?;
    let laws = asked.as_ref().unwrap_or(&own);
    // Doubts about the runs come before the warnings of a prediction.
    let doubts: Vec<Doubt> = laws.answer().doubts;
    let of_runs = || doubts.iter().filter(|doubt| doubt.kind == "rows").map(Doubt::sentence);
    let SizedArgs { params, tokens, vocab: n_vocab, params_vocab } = args.sized;
    if let (Some(params), Some(tokens)) = (params, tokens) {
        let model = ModelSize { params, n_vocab, params_vocab, tokens };
        let mut said = predict_sized(laws, &model)?;
        said.warnings.splice(0..0, of_runs());
        return output.result(&json!([said]), &sized_text(&said));
    }
    let predicted = |budget: &f64| -> Result<Prediction, PredictError> {
        let mut said = on_other_data(predict_one(laws, *budget)?, &own, args.unique_tokens);
        said.warnings.splice(0..0, of_runs());
        Ok(said)
    };
    let predictions: Vec<Prediction> =
        args.budgets.iter().map(predicted).collect::<Result<_, _>>()?;
    let text = said(&predictions, output.full);
    output.result(&serde_json::to_value(&predictions)?, &text)
}

/// The prediction, with a warning if it is for other data than the sweep's.
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

/// Predicts with FLOPs counted by the rule of the laws, if possible.
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

/// Predicts each budget; a budget that the laws cannot predict is a warning.
pub fn each(laws: &Laws, budgets: &[f64], output: &Output) -> Vec<Prediction> {
    let predicted = |budget: &f64| {
        let failed = |error: &PredictError| {
            output.warn(&format!("no prediction for {} FLOPs: {error}", count(*budget)));
        };
        predict_one(laws, *budget).inspect_err(failed).ok()
    };
    budgets.iter().filter_map(predicted).collect()
}

// `isoflop predict --params N --tokens D`: the loss of a given model.

#[derive(Args, Clone, Copy)]
#[command(next_help_heading = "Loss of a given model")]
struct SizedArgs {
    /// N of a given model, to predict its loss; N_nv if the law has N_v
    #[arg(long, value_name = "N", value_parser = amount, requires = "tokens")]
    params: Option<f64>,
    /// D, its training tokens
    #[arg(long, value_name = "D", value_parser = amount, requires = "params")]
    tokens: Option<f64>,
    /// V, for the laws of a sweep with several vocabularies
    #[arg(long, value_name = "V", value_parser = amount, requires = "params")]
    vocab: Option<f64>,
    /// N_v in place of V
    #[arg(long, value_name = "N_v", value_parser = amount, requires = "params", conflicts_with = "vocab")]
    params_vocab: Option<f64>,
}

/// A count of parameters or tokens.
fn amount(text: &str) -> Result<f64, String> {
    match number(&text.replace('_', "")) {
        Some(amount) if amount > 0.0 && amount.is_finite() => Ok(amount),
        _ => Err(format!("{text} is not a number above 0, as 7e9 or 7B")),
    }
}

// The count of FLOPs that scales a sweep's prediction onto its budget.

/// Training FLOPs by ScaMo's Code 1 along a ladder of shapes: what a token costs beside
/// its vocabulary is interpolated between rungs, in logarithms of N_nv; a code is chosen among
/// `head_share` of the vocabulary.
fn openai_count(
    n_ctx: usize,
    head_share: f64,
    ladder: &[predict::Shape],
) -> impl Fn(f64, f64, f64) -> f64 + Sync {
    let rung = |rung: &predict::Shape| {
        let flops = openai_blocks(rung.n_layer as usize, rung.d_model as usize, n_ctx);
        ((rung.params_nonvocab() as f64).ln(), flops.ln())
    };
    let rungs: Vec<(f64, f64)> = ladder.iter().map(rung).collect();
    move |nonvocab: f64, vocab: f64, tokens: f64| {
        let per_token = interpolate(&rungs, nonvocab.ln()).exp() + 2.0 * head_share * vocab;
        TRAINING_PER_FORWARD * per_token * tokens
    }
}

/// Forward FLOPs a token by the OpenAI rule beside the head, which depend on these numbers alone.
pub fn openai_blocks(n_layer: usize, d_model: usize, n_ctx: usize) -> f64 {
    let shape = ModelShape {
        n_layer,
        n_head: 1,
        d_model,
        d_ff: 0,
        n_ctx,
        d_text: 0,
        ffn: Ffn::SwiGlu,
        tie_embeddings: false,
        rope_base: 10_000.0,
    };
    openai_per_token(&shape, 0) as f64
}

/// Linear between the two nearest of at least two rising points, and beyond the ends.
fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let above = points.partition_point(|(at, _)| *at < x).clamp(1, points.len() - 1);
    let ((x0, y0), (x1, y1)) = (points[above - 1], points[above]);
    y0 + (y1 - y0) * (x - x0) / (x1 - x0)
}

// The laws named on the command line.

/// Laws at hand that are listed if none was chosen.
const MOST_NAMED: usize = 3;

/// The published law, or the laws of a sweep's folder or of a file.
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
    not_of_groups(path)?;
    let path = if path.is_dir() { path.join("laws.json") } else { path.to_path_buf() };
    match read_if_there(&path)? {
        Some(laws) => Ok(laws),
        None => bail!(
            "{} does not exist; laws are those of a sweep's folder, a laws.json or scamo",
            path.display()
        ),
    }
}

/// Refuses a folder of groups' laws, written by `isoflop fit TABLE --by COLUMN --out FOLDER`.
pub fn not_of_groups(folder: &Path) -> Result<()> {
    let of_sweep = ["sweep.yaml", "runs.parquet", "runs.csv", "laws.json", "generators"];
    if of_sweep.iter().any(|name| folder.join(name).exists()) {
        return Ok(());
    }
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let laws = files.filter(|path| path.extension().is_some_and(|end| end == "json"));
    match laws.min() {
        Some(one) => {
            bail!("{} holds laws of groups: name one, as {}", folder.display(), one.display())
        }
        None => Ok(()),
    }
}

/// The error if no law is named: the choices, with the laws in the working directory.
fn missing() -> anyhow::Error {
    // Laws below the working directory, sorted: sweeps in `results`, and `laws.json`.
    let entries = std::fs::read_dir("results").into_iter().flatten().flatten();
    let folders = entries.map(|entry| entry.path()).filter(|path| path.join("laws.json").exists());
    let mut found: Vec<String> = folders.map(|path| path.display().to_string()).collect();
    found.sort();
    found.extend(Path::new("laws.json").exists().then(|| "laws.json".to_string()));
    found.truncate(MOST_NAMED);
    let here = match &found[..] {
        [] => String::new(),
        all => format!("; here: --law {}", all.join(", --law ")),
    };
    anyhow::anyhow!(
        "no law to predict by: give --law results/NAME for a sweep's, --law FILE for one that \
         isoflop fit saved by --out, or --law scamo for the published one{here}"
    )
}
