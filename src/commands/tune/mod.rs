//! `isoflop tune`: the rule of learning rate and batch, by trials at a few cells of a sweep's grid.

mod text;
mod trials;

use std::ops::ControlFlow;

use anyhow::{Context, Result, bail};
use clap::Args;
use isoflop::engine::{ENGINES, Engine};
use isoflop::files::atomic;
use isoflop::jobs::presence::Held;
use isoflop::jobs::{ResultsFolder, adopt};
use isoflop::rates::{Trial, fit_rule, next};
use serde_json::json;

use super::args::{SweepArgs, an_engine};
use super::context::OpenSweep;
use super::exit::Exit;
use super::output::Output;
use super::run::{RunArgs, bring, hold, open};
use trials::{Asked, Cells};

#[derive(Args)]
pub struct TuneArgs {
    #[command(flatten)]
    sweep: SweepArgs,
    /// Cells of the grid that rates are tried at
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(2..))]
    cells: u16,
    /// Where jobs run
    #[arg(long, value_parser = an_engine(), default_value = ENGINES[0].name())]
    engine: &'static dyn Engine,
}

pub fn tune(args: &TuneArgs, output: &Output) -> Result<Exit> {
    if args.engine.hands_over() {
        bail!("each trial waits for those before it: use --engine local");
    }
    let mut run = RunArgs::of(args.sweep.clone(), args.engine);
    run.said_as = vec!["tune".into(), "--cells".into(), args.cells.to_string()];
    let whole = open(&run, output)?;
    if !whole.sweep.grid.vary.is_empty() {
        bail!("tune looks for rates itself: take grid.vary out of the sweep");
    }
    let cells = Cells::of(&whole, args.cells.into())?;
    let own = ResultsFolder::new(whole.folder.file("rates"));
    let part = OpenSweep { folder: own, ..whole.clone() };
    let mut held = Some(hold(&part, output)?);
    adopt(&whole.plan, &whole.folder, &part.folder)?;
    let trials = match search(&run, &cells, &part, &mut held, output)? {
        ControlFlow::Continue(trials) => trials,
        ControlFlow::Break(exit) => return Ok(exit),
    };
    adopt(&whole.plan, &part.folder, &whole.folder)?;
    let rule = fit_rule(&cells.places, &whole.sweep.train, &trials)
        .context("fewer than two cells have a rate at which a run ends")?;
    let document = json!({ "rule": rule, "trials": trials });
    atomic::write_json(&part.folder.file("rates.json"), &document)?;
    let yaml = text::yaml(&rule, &part.sweep)?;
    atomic::write_bytes(&part.folder.file("rates.yaml"), yaml.as_bytes())?;
    output.result(&document, &text::text(&rule, trials.len(), &part.folder))
}

/// Every trial until there is nothing more to try. Those that ended before are read, not trained.
fn search(
    args: &RunArgs,
    cells: &Cells,
    part: &OpenSweep,
    held: &mut Option<Held>,
    output: &Output,
) -> Result<ControlFlow<Exit, Vec<Trial>>> {
    let mut trials: Vec<Trial> = Vec::new();
    let mut all: Vec<Asked> = Vec::new();
    loop {
        let wanted = next(cells.places.len(), part.sweep.train.schedule.kind, &trials);
        if wanted.is_empty() {
            return Ok(ControlFlow::Continue(trials));
        }
        let asked = cells.asked(&part.sweep, &part.plan, wanted);
        all.extend(asked.iter().cloned());
        if asked.iter().any(|asked| asked.is_open(&part.folder)) {
            output.note(&text::price(&asked, all.len()));
            let runs = all.iter().filter_map(|asked| asked.run.clone());
            let plan = part.plan.with_runs(runs.collect());
            let open = OpenSweep { plan, ..part.clone() };
            if let ControlFlow::Break(exit) = bring(args, &open, held, |_| true, output)? {
                return Ok(ControlFlow::Break(exit));
            }
        }
        for asked in &asked {
            trials.push(asked.trial(&part.folder)?);
        }
    }
}
