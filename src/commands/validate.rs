//! `isoflop validate`: forecasts a budget beyond the fit, and trains the runs that test it.

use super::args::budget;
use super::context::{SweepArgs, WorkArgs, an_engine};
use super::fit::points;
use super::generators::sweep_of;
use super::plan_text::time;
use super::predict::{laws_of, predict_one};
use super::prelude::*;
use super::run::{RunArgs, run_then};
use super::sizes::{codes, distinct, model};
use isoflop::engine::{ENGINES, Engine};
use isoflop::laws::{
    Inside, IsoFlopPoint, Measured, MinimumMethod, NoiseSource, Predicted, RunNoise, TriedCells,
    Validated, cross_optimum, minimum_at, tied_cells, times,
};
use isoflop::record::{flops_per_second, table, table as runs};
use isoflop::spec::{Clips, Origin};
use isoflop::sweep::{GridSection, HoldOutSpec, ModelEntry, ModelList, VocabSpec};
use isoflop::words::prediction::said;
use std::collections::BTreeSet;

/// Shown below the options.
const EXAMPLES: &str = "\
Examples:
  Register a forecast, then train the cells that test it
    isoflop validate results/NAME --budget 1e13 --register
    isoflop validate results/NAME --budget 1e13

docs/validate.md explains which cells are trained and how to read the comparison.";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct ValidateArgs {
    /// A sweep's folder
    #[arg(value_name = "RESULTS")]
    results: PathBuf,
    /// The budget in FLOPs, e.g. 1e12
    #[arg(long, value_name = "C", value_parser = budget)]
    budget: f64,
    /// Register the forecast, and train nothing yet
    #[arg(long)]
    register: bool,
    /// Seeds of each cell (model and vocabulary); by default the sweep's
    #[arg(long, value_name = "S,…", value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Override a setting of the runs, e.g. data.clips=400000; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    settings: Vec<String>,
    #[command(flatten)]
    work: WorkArgs,
    /// Where jobs run
    #[arg(long, value_parser = an_engine(), default_value = ENGINES[0].name())]
    engine: &'static dyn Engine,
}

pub fn validate(args: &ValidateArgs, output: &Output) -> Result<Exit> {
    // The budget names every file of the validation.
    let name = format!("{:e}", args.budget);
    let sweep = sweep_of(&ResultsFolder::new(&args.results))?;
    if !sweep.grid.vary.is_empty() {
        bail!("{} varies other keys, and a forecast is tested with one value of each", sweep.name);
    }
    let forecast = forecast(args, &name, output)?;
    if forecast.extrapolation_factor <= 1.0 {
        output.warn(&format!("{name} FLOPs are within the fit: these runs test no forecast"));
    }
    if args.register {
        let text = said(std::slice::from_ref(&forecast), output.full);
        return output.result(&json!(forecast), &text);
    }
    let rule = sweep.flops.rule;
    let own = around(&sweep, &forecast, &name, &args.seeds)?;
    let sizes = if let ModelList::List(models) = &own.grid.models { models.len() } else { 1 };
    output.note(&price(args, sizes + own.grid.vocab.len() - 1)?);
    let sweep = SweepArgs {
        sweep: root(args).join(format!("{name}.yaml")),
        settings: args.settings.clone(),
        out: root(args),
        work: args.work.clone(),
    };
    atomic::write_bytes(&sweep.sweep, serde_yaml::to_string(&own)?.as_bytes())?;
    run_then(&RunArgs::of(sweep, args.engine), output, |folder| {
        let laws = laws_of(&args.results)?;
        let validated = compare(folder, (&laws, &forecast), rule)?;
        atomic::write_json(&folder.file("validation.json"), &validated)?;
        // Every validation of the sweep, in its laws.
        let (own, mut laws) = (ResultsFolder::new(&args.results), laws_of(&args.results)?);
        laws.judgement.validations = own.validations(|line| output.warn(&line));
        atomic::write_json(&own.file("laws.json"), &laws.answered())?;
        output.result(&json!(validated), &compared(&validated))?;
        Ok(())
    })
}

/// The expected cost of the cells, by the speed of the sweep's runs.
fn price(args: &ValidateArgs, cells: usize) -> Result<String> {
    let flops = cells as f64 * args.budget;
    let rate = flops_per_second(table::read(&args.results)?);
    let hours = rate.map_or_else(String::new, |rate| {
        format!(": about {} of a core at the rate of the sweep's runs", time(flops / rate / 3600.0))
    });
    Ok(format!(
        "{cells} cells, {flops:.2e} FLOPs for each seed and tokenizer{hours}; tokenizers and codes are \
         made beside that"
    ))
}

/// The folder of a sweep's validations.
fn root(args: &ValidateArgs) -> PathBuf {
    args.results.join("validations")
}

/// The forecast that was written down before any run, or one that is written down now.
fn forecast(args: &ValidateArgs, name: &str, output: &Output) -> Result<Prediction> {
    let path = root(args).join(name).join("forecast.json");
    if let Some(forecast) = read_if_there::<Prediction>(&path)? {
        output.note(&format!("the forecast in {} is used", path.display()));
        return Ok(forecast);
    }
    let forecast = predict_one(&laws_of(&args.results)?, args.budget)?;
    atomic::write_json(&path, &forecast)?;
    Ok(forecast)
}

// The cells round a predicted optimum.

/// The factors between the forecast's size, or vocabulary, and its neighbours if no interval is known.
const SIZE_STEP: f64 = 1.6;
const VOCAB_STEP: f64 = 2.0;
/// Factor between the end of an interval and the outermost cell: a forecast that is wrong by so much fails.
const BEYOND: f64 = 2.0;
/// Largest factor between the forecast and a cell: a wider valley cannot be resolved.
const FARTHEST: f64 = 8.0;

/// The sweep around a forecast: sizes and vocabularies within and beyond its intervals, trained like the sweep's
/// runs, with more data if it is made on demand.
fn around(sweep: &Sweep, forecast: &Prediction, name: &str, seeds: &[u64]) -> Result<Sweep> {
    let (Some(size), Some(vocab)) = (forecast.at.params_nonvocab, forecast.at.n_vocab) else {
        bail!("the laws of {} tell no vocabulary, so there is nothing to build", sweep.name);
    };
    let sizes = levels(size, forecast.ci95.at.params_nonvocab, SIZE_STEP);
    let sizes: Vec<ModelEntry> =
        sizes.iter().map(|size| model(sweep, *size)).collect::<Result<_>>()?;
    let vocabularies = match &sweep.grid.vocab[..] {
        // A single vocabulary is the trainer's own, or was chosen: the forecast is for this one.
        [only] => vec![only.clone(); 2 * MIDDLE + 1],
        _ => levels(vocab, forecast.ci95.at.n_vocab, VOCAB_STEP).map(|v| codes(v, sweep)).to_vec(),
    };
    // Half of a small vocabulary may leave a codebook without codes.
    let buildable = vocabularies.iter().filter(|codes| sweep.quantizer(codes).is_ok());
    let mut own = sweep.clone();
    own.name = name.to_string();
    own.grid = GridSection {
        exclude: corners(&sizes[MIDDLE], &vocabularies[MIDDLE], sweep)?,
        models: ModelList::List(distinct(sizes)),
        vocab: distinct(buildable.cloned().collect()),
        budgets: vec![forecast.budget_flops],
        shares: vec![1.0],
        zip: Vec::new(),
        vary: BTreeMap::new(),
        also: Vec::new(),
    };
    if !seeds.is_empty() {
        own.seeds = seeds.to_vec();
    }
    if own.data.origin() == Origin::Procedural {
        own.data.clips = Clips::Auto;
    }
    own.fit.hold_out = HoldOutSpec::None;
    own.fit.bootstrap = 0;
    own.predict.budgets = Vec::new();
    Ok(own)
}

/// The index of the forecast among [`levels`].
const MIDDLE: usize = 2;

/// A value, two beyond the ends of its interval, and two halfway there in logarithms.
fn levels(value: f64, interval: Option<[f64; 2]>, step: f64) -> [f64; 5] {
    let [low, high] = interval.unwrap_or([value, value]);
    let low = (low / BEYOND).min(value / step.powi(2)).max(value / FARTHEST);
    let high = (high * BEYOND).max(value * step.powi(2)).min(value * FARTHEST);
    [low, (low * value).sqrt(), value, (value * high).sqrt(), high]
}

/// The condition that leaves out a cell off both axes of the cross through the middle.
fn corners(model: &ModelEntry, vocabulary: &VocabSpec, sweep: &Sweep) -> Result<Vec<String>> {
    let (n_vocab, d_model) = (sweep.quantizer(vocabulary)?.n_vocab(), model.d_model);
    let sides = ["<", ">"];
    let pairs = sides.iter().flat_map(|size| sides.map(|vocab| (size, vocab)));
    let corner = |(size, vocab): (&&str, &str)| {
        format!("d_model {size} {d_model} and n_vocab {vocab} {n_vocab}")
    };
    Ok(pairs.map(corner).collect())
}

// Compares a forecast with the runs that test it.

/// The forecast of some laws, and the best cell of the validation's folder.
fn compare(
    folder: &ResultsFolder,
    (laws, forecast): (&Laws, &Prediction),
    rule: FlopsRule,
) -> Result<Validated> {
    let records = runs::read(folder.root())?;
    let (points, left_out) = points(&records, rule);
    // The scatter of cells around a surface is the noise or more: it may include misfit.
    let is_of_runs = |noise: &RunNoise| !matches!(noise.source, NoiseSource::Surface { .. });
    let of_a_run = laws.noise.filter(is_of_runs).map(|noise| noise.sd);
    let measured =
        best(&points, of_a_run).context(left_out.unwrap_or_else(|| "no run is finished".into()))?;
    let measured = Measured { loss_nats: cross_entropy(&records, &points, &measured), ..measured };
    let ci = &forecast.ci95;
    let predicted = Predicted {
        loss: forecast.loss_normalised,
        loss_ci95: ci.loss_normalised,
        params_nonvocab: forecast.at.params_nonvocab,
        params_nonvocab_ci95: ci.at.params_nonvocab,
        params_vocab: forecast.at.params_vocab,
        params_vocab_ci95: ci.at.params_vocab,
        tokens: forecast.at.tokens,
        tokens_ci95: ci.at.tokens,
    };
    let at = (forecast.budget_flops, forecast.extrapolation_factor);
    Ok(Validated::new(at, predicted, measured))
}

/// The mean cross-entropy of the best cell's runs, if all have it.
fn cross_entropy(records: &[RunRecord], points: &[IsoFlopPoint], best: &Measured) -> Option<f64> {
    let is_best = |point: &&IsoFlopPoint| {
        (point.params_nonvocab, point.n_vocab) == (best.params_nonvocab, best.n_vocab)
    };
    let of = |point: &IsoFlopPoint| {
        let record = records.iter().find(|record| record.planned.run_id == point.run_id)?;
        record.metrics.get("loss_nats")
    };
    let losses: Option<Vec<f64>> = points.iter().filter(is_best).map(of).collect();
    losses.map(|losses| losses.iter().sum::<f64>() / losses.len() as f64)
}

/// The cell of the lowest mean loss.
fn best(points: &[IsoFlopPoint], of_a_run: Option<f64>) -> Option<Measured> {
    let best = minimum_at(MinimumMethod::Argmin, &points.iter().collect::<Vec<_>>())?;
    let distinct = |of: fn(&IsoFlopPoint) -> f64| {
        let bits: BTreeSet<u64> = points.iter().map(|point| of(point).to_bits()).collect();
        Some(bits.len())
    };
    Some(Measured {
        loss: best.loss_normalised,
        params_nonvocab: best.params_nonvocab,
        params_vocab: best.params_vocab,
        n_vocab: best.n_vocab,
        tokens: best.tokens,
        runs: points.len(),
        sizes: distinct(|point| point.params_nonvocab),
        vocabularies: distinct(|point| point.n_vocab),
        tried: Some(TriedCells {
            params_nonvocab: range(points, |point| point.params_nonvocab),
            params_vocab: range(points, |point| point.params_vocab),
        }),
        optimum: cross_optimum(points),
        tied: tied_cells(points, of_a_run),
        loss_nats: None,
    })
}

/// The smallest and the largest value.
fn range(points: &[IsoFlopPoint], of: fn(&IsoFlopPoint) -> f64) -> [f64; 2] {
    let values = || points.iter().map(of);
    [values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max)]
}

/// The comparison, one line per quantity.
fn compared(validated: &Validated) -> String {
    let Validated { predicted, measured, inside, .. } = validated;
    let Inside { loss, params_nonvocab, params_vocab, tokens } = *inside;
    let size = (predicted.params_nonvocab, predicted.params_nonvocab_ci95);
    let vocab = (predicted.params_vocab, predicted.params_vocab_ci95);
    let [size_found, vocab_found, tokens_found] = measured.at();
    let rows = [
        ("L_u", (predicted.loss, predicted.loss_ci95), measured.loss, loss),
        ("N_nv", size, size_found, params_nonvocab),
        ("N_v", vocab, vocab_found, params_vocab),
        ("D", (predicted.tokens, predicted.tokens_ci95), tokens_found, tokens),
    ];
    let rows = rows.map(|(name, (value, interval), found, inside)| {
        let number = |x: f64| if name == "L_u" { format!("{x:.4}") } else { format!("{x:.3e}") };
        let lies_outside = interval.is_some_and(|[low, high]| !(low..=high).contains(&found));
        let verdict = match inside {
            Some(true) => "inside",
            Some(false) => "OUTSIDE",
            None if name == "N_v" && measured.vocabularies == Some(1) => "not varied",
            None if lies_outside => "a tie, within the noise of the runs",
            None if interval.is_some() => "could not have failed",
            None => "",
        };
        let interval = dash(interval, |[low, high]| format!("{}..{}", number(low), number(high)));
        [name.to_string(), dash(value, number), interval, number(found), verdict.to_string()]
    });
    let mut out = format!(
        "{:e} FLOPs, {} times beyond the fit, {} runs:\n{}",
        validated.budget_flops,
        times(validated.extrapolation_factor),
        measured.runs,
        table(["<", "forecast", "95 % interval", "measured", "<"], rows)
    );
    if let Some([forecast, found]) = validated.cross_entropy() {
        let off = |forecast: f64, found: f64| 100.0 * ((forecast - found) / found).abs();
        let of_loss = predicted.loss.map_or(f64::NAN, |loss| off(loss, measured.loss));
        out += &format!(
            "cross-entropy of the best cell: {forecast:.4} nats forecast, {found:.4} measured, {:.2} % off\n\
             (of L_u {of_loss:.2} %)\n",
            off(forecast, found)
        );
    }
    if measured.optimum.is_some() {
        out += &format!(
            "N_nv, N_v and D measured by parabolas through the cells;\nthe best cell has {:.3e}, {:.3e}, {:.3e}\n",
            measured.params_nonvocab, measured.params_vocab, measured.tokens
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::levels;

    #[test]
    fn cells_lie_beyond_both_ends_of_an_interval_so_that_a_forecast_can_fail() {
        let [low, below, middle, above, high] = levels(100.0, Some([50.0, 300.0]), 1.6);
        assert_eq!([low, middle, high], [25.0, 100.0, 600.0]);
        assert!(low < below && below < middle && middle < above && above < high);
        let [low, .., high] = levels(100.0, None, 2.0);
        assert_eq!([low, high], [25.0, 400.0]);
        let [low, .., high] = levels(100.0, Some([1.0, 1e5]), 2.0);
        assert_eq!([low, high], [12.5, 800.0], "an interval that knows nothing");
    }
}
