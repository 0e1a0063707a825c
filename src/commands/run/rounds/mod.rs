//! `isoflop run --rounds`: a part of the grid at a time, until a prediction is sharp enough.

mod history;

use std::collections::HashSet;
use std::ops::ControlFlow;

use anyhow::{Context, Result, bail};
use isoflop::jobs::JobState;
use isoflop::laws::{DesignGoal, OpenRun, next_runs};
use isoflop::plan::{Plan, PlannedRun};
use isoflop::record::{RunRecord, flops_per_second};

use super::summary::Summary;
use super::{RunArgs, bring, open};
use crate::commands::analyse;
use crate::commands::context::OpenSweep;
use crate::commands::exit::Exit;
use crate::commands::fit::{fit_records, options, points};
use crate::commands::output::Output;
use crate::commands::plan_text::time;
use crate::commands::predict::predict_one;
use history::{History, Known, Round};

/// The share of the grid's FLOPs that a round spends at least, where windows grow.
const SHARE: f64 = 0.05;

/// Rounds of runs until the interval is as narrow as asked, the rounds are over or the grid is.
///
/// Each round is written down before it is trained, so that the same command goes on with it.
pub fn run_in_rounds(args: &RunArgs, most: usize, output: &Output) -> Result<Exit> {
    if args.engine.hands_over() {
        bail!("--rounds waits for the runs of each round: use it with --engine local");
    }
    let whole = open(args, output)?;
    let budget = budget(&whole)?;
    let mut history = History::read(&whole.folder, &whole.plan)?;
    let mut exit = Exit::Done;
    while exit == Exit::Done && begin(args, most, &whole, budget, &mut history, output)? {
        let part = part(&whole, &history);
        output.note(&price(&whole.plan, &history, &finished(&part)));
        exit = match bring(args, &part, |_| true, output)? {
            ControlFlow::Continue(reports) => {
                Summary::new(args, &part.plan, &part.folder, &reports)?.tell(output)
            }
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
    output: &Output,
) -> Result<bool> {
    if history.is_open() {
        return Ok(true);
    }
    let met = history.known().is_some_and(|known| is_met(known, args.until));
    if met || history.rounds.len() >= most {
        return Ok(false);
    }
    let runs = next(whole, history, budget, output)?;
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

fn is_met(known: &Known, until: Option<f64>) -> bool {
    until.zip(known.half_width()).is_some_and(|(until, width)| width <= until)
}

/// The runs of the next round, by id; none where the grid is trained.
fn next(
    whole: &OpenSweep,
    history: &History,
    budget_flops: f64,
    output: &Output,
) -> Result<Vec<String>> {
    let records = match history.rounds.is_empty() {
        true => Vec::new(),
        false => analyse::gather(&whole.folder, output)?,
    };
    let (points, _) = points(&records, whole.sweep.flops.rule);
    let (taken, states): (HashSet<&str>, _) = (history.runs().collect(), whole.folder.run_states());
    let is_open = |run: &&PlannedRun| {
        !taken.contains(run.run_id.as_str()) && states.of(&run.run_id) != JobState::Failed
    };
    let open: Vec<&PlannedRun> = whole.plan.runs.iter().filter(is_open).collect();
    let offered: Vec<OpenRun> = open.iter().map(|run| open_run(&whole.plan, run)).collect();
    let spend_flops = SHARE * whole.plan.total_flops();
    let chosen = next_runs(&points, &offered, DesignGoal { budget_flops, spend_flops });
    Ok(chosen.into_iter().map(|i| open[i].run_id.clone()).collect())
}

fn open_run(plan: &Plan, run: &PlannedRun) -> OpenRun {
    let unique_tokens = plan.data.unique_tokens(&run.spec.codes);
    OpenRun {
        budget_flops: run.spec.budget_flops,
        flops: run.spec.budget_flops,
        params_nonvocab: run.params.nonvocab as f64,
        n_vocab: run.spec.n_vocab() as f64,
        tokens: run.spec.tokens() as f64,
        unique_tokens: (unique_tokens > 0).then_some(unique_tokens as f64),
    }
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
    read.filter_map(|record| record.ok().flatten()).collect()
}

/// What the prediction is after a round.
fn known(part: &OpenSweep, budget_flops: f64, output: &Output) -> Known {
    let laws = || {
        let records = analyse::gather(&part.folder, output)?;
        let laws = fit_records(&records, &options(&part.sweep))?;
        let prediction = predict_one(&laws, budget_flops)?;
        anyhow::Ok((laws, prediction))
    };
    match laws() {
        Ok((laws, prediction)) => Known {
            budget_flops,
            loss_normalised: prediction.loss_normalised,
            loss_ci95: prediction.ci95.loss_normalised,
            is_tested: laws.judgement.forecast_error.is_some_and(|error| error.tested > 0),
        },
        Err(reason) => {
            output.note(&format!("no laws yet: {reason:#}"));
            Known { budget_flops, loss_normalised: None, loss_ci95: None, is_tested: false }
        }
    }
}

/// What a round is about to cost.
fn price(plan: &Plan, history: &History, records: &[RunRecord]) -> String {
    let (number, total) = (history.rounds.len(), plan.total_flops());
    let Some(round) = history.rounds.last() else { return String::new() };
    let rate = flops_per_second(records.iter().cloned());
    let hours = rate.map_or_else(String::new, |rate| {
        format!(", {} of one core", time(round.flops / rate / 3600.0))
    });
    format!(
        "round {number}: {} runs, {:.2e} FLOPs{hours}; {:.0} % of the grid's FLOPs with those before",
        round.runs.len(),
        round.flops,
        100.0 * history.flops() / total
    )
}

/// What is known after a round.
fn said(number: usize, known: &Known) -> String {
    let Known { budget_flops, loss_normalised, loss_ci95, is_tested } = known;
    let (Some(loss), Some([low, high])) = (loss_normalised, loss_ci95) else {
        return format!("round {number}: no prediction yet");
    };
    let width = match known.half_width() {
        Some(width) => format!("±{:.1} %", 100.0 * width),
        None if *is_tested => "of no width".to_string(),
        None => "which no larger budget has tested yet".to_string(),
    };
    format!(
        "round {number}: L_u at {budget_flops:.0e} FLOPs is {loss:.3} (95 %: {low:.3} to {high:.3}), {width}"
    )
}

/// Why the rounds are over.
fn conclude(args: &RunArgs, plan: &Plan, history: &History, output: &Output) {
    let runs = history.runs().count();
    let done = format!(
        "{} rounds took {runs} of {} runs and {:.0} % of the grid's FLOPs",
        history.rounds.len(),
        plan.runs.len(),
        100.0 * history.flops() / plan.total_flops()
    );
    let met = history.known().is_some_and(|known| is_met(known, args.until));
    match args.until {
        Some(until) if !met => {
            output.warn(&format!("{done}; the interval is wider than --until {until}"));
        }
        _ => output.note(&done),
    }
}
