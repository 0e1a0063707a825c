//! `isoflop run --rounds`: a part of the grid at a time, until a prediction is sharp enough.

mod history;
mod next;
mod words;

use std::collections::HashSet;
use std::ops::ControlFlow;

use anyhow::{Context, Result, bail};
use isoflop::plan::Plan;
use isoflop::record::{RunRecord, table};

use super::args::RunArgs;
use super::bring::{bring, hold, open};
use crate::commands::analyse;
use crate::commands::context::OpenSweep;
use crate::commands::exit::Exit;
use crate::commands::fit::{fit_records, options};
use crate::commands::output::Output;
use crate::commands::predict::predict_one;
use history::{AfterRound, History, Round};
use next::next;
use words::{price, said};

/// Rounds of runs until the interval is as narrow as asked, the rounds are over or the grid is.
///
/// Each round is written down before it is trained, so that the same command goes on with it.
pub fn run_in_rounds(args: &RunArgs, most: usize, output: &Output) -> Result<Exit> {
    if args.engine.hands_over() {
        bail!("--rounds waits for the runs of each round: use it with --engine local");
    }
    let whole = open(args, output)?;
    if !whole.sweep.grid.vary.is_empty() {
        bail!("--rounds chooses cells, and not among the values of grid.vary: run without it");
    }
    if whole.sweep.grid.shares != [1.0] {
        bail!("--rounds chooses cells, and not among the values of grid.shares: run without it");
    }
    let budget = budget(&whole)?;
    let mut held = Some(hold(&whole, output)?);
    let mut history = History::read(&whole.folder, &whole.plan)?;
    let mut exit = Exit::Done;
    while exit == Exit::Done && begin(args, most, &whole, budget, &mut history)? {
        let part = part(&whole, &history);
        output.note(&price(&whole.plan, &history, finished(&part)));
        exit = match bring(args, &part, &mut held, |_| true, output)? {
            ControlFlow::Continue(summary) => summary.tell(output),
            ControlFlow::Break(stopped) => return Ok(stopped),
        };
        let known = known(&part, budget, output);
        output.note(&said(history.rounds.len(), &known));
        history.rounds.last_mut().context("a round was begun")?.known = Some(known);
        history.write(&whole.folder)?;
    }
    conclude(args, &whole.plan, &history, output);
    analyse::finish(&whole.folder, output)?;
    Ok(exit)
}

/// Whether there is a round to train: one that was begun before, or a new one.
fn begin(
    args: &RunArgs,
    most: usize,
    whole: &OpenSweep,
    budget: f64,
    history: &mut History,
) -> Result<bool> {
    if history.is_open() {
        return Ok(true);
    }
    let met = history.known().is_some_and(|known| is_met(known, args.options.until));
    if met || history.rounds.len() >= most {
        return Ok(false);
    }
    let runs = next(whole, &finished(&part(whole, history)), history, budget);
    if runs.is_empty() {
        return Ok(false);
    }
    history.rounds.push(Round::of(runs, &whole.plan));
    history.write(&whole.folder)?;
    Ok(true)
}

/// The largest budget that the sweep predicts.
fn budget(open: &OpenSweep) -> Result<f64> {
    let asked = open.sweep.predict.budgets.iter().copied().reduce(f64::max);
    asked.context(
        "--rounds sharpens a prediction: name its budget, as in --set predict.budgets=[1e12]",
    )
}

fn is_met(known: &AfterRound, until: Option<f64>) -> bool {
    until.zip(known.half_width()).is_some_and(|(until, width)| width <= until)
}

/// The sweep with the runs of the rounds alone.
fn part(whole: &OpenSweep, history: &History) -> OpenSweep {
    let taken: HashSet<&str> = history.runs().collect();
    OpenSweep {
        sweep: whole.sweep.clone(),
        plan: whole.plan.only(|run| taken.contains(run.run_id.as_str())),
        folder: whole.folder.clone(),
    }
}

/// The records of the runs that are trained; one that is damaged is trained again, and told of then.
fn finished(part: &OpenSweep) -> Vec<RunRecord> {
    let read = part.plan.runs.iter().map(|run| part.folder.record(&run.run_id));
    let mut records: Vec<RunRecord> = read.filter_map(|record| record.ok().flatten()).collect();
    table::sort(&mut records);
    records
}

/// What the prediction is after a round.
fn known(part: &OpenSweep, budget_flops: f64, output: &Output) -> AfterRound {
    let laws = || {
        let laws = fit_records(&finished(part), &options(&part.sweep))?;
        let prediction = predict_one(&laws, budget_flops)?;
        anyhow::Ok((laws, prediction))
    };
    match laws() {
        Ok((laws, prediction)) => AfterRound {
            budget_flops,
            loss_normalised: prediction.loss_normalised,
            loss_ci95: prediction.ci95.loss_normalised,
            is_tested: laws.judgement.forecast_error.is_some_and(|error| error.tested > 0),
        },
        Err(reason) => {
            output.note(&format!("no laws yet: {reason:#}"));
            AfterRound { budget_flops, loss_normalised: None, loss_ci95: None, is_tested: false }
        }
    }
}

/// Why the rounds are over.
fn conclude(args: &RunArgs, plan: &Plan, history: &History, output: &Output) {
    let taken = words::taken(plan, history);
    let met = history.known().is_some_and(|known| is_met(known, args.options.until));
    match args.options.until {
        Some(until) if !met => {
            output.warn(&format!("{taken}; the interval is wider than --until {until}"));
        }
        _ => output.note(&taken),
    }
}
