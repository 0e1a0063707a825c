//! `isoflop validate`: a forecast at a budget that took no part in the fit, and the runs that test it.

mod compare;
mod grid;

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use isoflop::engine::{ENGINES, Engine};
use isoflop::files::{atomic, read_if_there};
use isoflop::jobs::ResultsFolder;
use isoflop::predict::Prediction;
use isoflop::record::{flops_per_second, table};
use isoflop::words::prediction::said;
use serde_json::json;

use super::args::{SweepArgs, WorkArgs, an_engine, budget};
use super::by_generator::sweep_of;
use super::exit::Exit;
use super::output::Output;
use super::plan_text::time;
use super::predict::{laws_of, predict_one};
use super::run::{RunArgs, run_then};

pub use compare::{gathered, validation_folders};

/// Shown below the options.
const EXAMPLES: &str = "\
Examples:
  Write a forecast down before anybody runs it, then train the cells that test it
    isoflop validate results/NAME --budget 1e13 --register
    isoflop validate results/NAME --budget 1e13

docs/validate.md tells which cells are trained, and what is said of them.";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct ValidateArgs {
    /// A sweep's folder
    #[arg(value_name = "RESULTS")]
    results: PathBuf,
    /// The budget in FLOPs, as in 1e12
    #[arg(long, value_name = "C", value_parser = budget)]
    budget: f64,
    /// Write the forecast down, and train nothing yet
    #[arg(long)]
    register: bool,
    /// Seeds of each cell; by default those of the sweep
    #[arg(long, value_name = "S,…", value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Override a setting of the runs, as in data.clips=400000; may be repeated
    #[arg(long = "set", value_name = "PATH=VALUE")]
    settings: Vec<String>,
    #[command(flatten)]
    work: WorkArgs,
    /// Where jobs run
    #[arg(long, value_parser = an_engine(), default_value = ENGINES[0].name())]
    engine: &'static dyn Engine,
}

pub fn validate(args: &ValidateArgs, output: &Output) -> Result<Exit> {
    // The budget names all that is of the validation.
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
    let own = grid::around(&sweep, &forecast, &name, &args.seeds)?;
    output.note(&price(args, grid::cells(&own))?);
    let sweep = SweepArgs {
        sweep: root(args).join(format!("{name}.yaml")),
        settings: args.settings.clone(),
        out: root(args),
        work: args.work.clone(),
    };
    atomic::write_bytes(&sweep.sweep, serde_yaml::to_string(&own)?.as_bytes())?;
    run_then(&RunArgs::of(sweep, args.engine), output, |folder| {
        let laws = laws_of(&args.results)?;
        let validated = compare::compare(folder, (&laws, &forecast), rule)?;
        atomic::write_json(&folder.file("validation.json"), &validated)?;
        keep(args, output)?;
        output.result(&json!(validated), &compare::text(&validated))?;
        Ok(())
    })
}

/// What the cells are about to cost, by the rate of the sweep's own runs.
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
        output.note(&format!("the forecast of {} stands", path.display()));
        return Ok(forecast);
    }
    let forecast = predict_one(&laws_of(&args.results)?, args.budget)?;
    atomic::write_json(&path, &forecast)?;
    Ok(forecast)
}

/// Every validation of the sweep, in its laws.
fn keep(args: &ValidateArgs, output: &Output) -> Result<()> {
    let folder = ResultsFolder::new(&args.results);
    let mut laws = laws_of(&args.results)?;
    laws.judgement.validations = gathered(&folder, output);
    let laws = laws.answered();
    Ok(atomic::write_json(&folder.file("laws.json"), &laws)?)
}
