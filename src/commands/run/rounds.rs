//! `isoflop run --rounds`: trains the grid in parts until a prediction is narrow enough.

use super::bring::{bring, hold, open};
use super::command_line::RunArgs;
use crate::commands::analyse;
use crate::commands::context::OpenSweep;
use crate::commands::fit::{fit_records, options, points};
use crate::commands::plan_text::time;
use crate::commands::predict::predict_one;
use crate::commands::prelude::*;
use isoflop::jobs::JobState;
use isoflop::laws::{DesignGoal, OpenRun, next_runs};
use isoflop::plan::{Plan, PlannedRun};
use isoflop::record::{flops_per_second, table};
use std::collections::HashSet;
use std::ops::ControlFlow;

/// Trains rounds of runs until the interval is narrow enough, or the rounds or the grid are finished.
///
/// Each round is saved before it is trained, so that the same command resumes it.
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
    let budget = whole.sweep.predict.budgets.iter().copied().reduce(f64::max).context(
        "--rounds sharpens a prediction: name its budget, as in --set predict.budgets=[1e12]",
    )?;
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

/// Whether there is a round to train: an unfinished one, or a new one.
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
    if history.is_met(args.options.until) || history.rounds.len() >= most {
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

/// The sweep with the runs of the rounds alone.
fn part(whole: &OpenSweep, history: &History) -> OpenSweep {
    let taken: HashSet<&str> = history.runs().collect();
    OpenSweep {
        sweep: whole.sweep.clone(),
        plan: whole.plan.only(|run| taken.contains(run.run_id.as_str())),
        folder: whole.folder.clone(),
    }
}

/// The records of trained runs; a damaged one is trained again, with a warning.
fn finished(part: &OpenSweep) -> Vec<RunRecord> {
    let read = part.plan.runs.iter().map(|run| part.folder.record(&run.run_id));
    let mut records: Vec<RunRecord> = read.filter_map(|record| record.ok().flatten()).collect();
    table::sort(&mut records);
    records
}

/// The prediction after a round.
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

/// Reports why the rounds ended.
fn conclude(args: &RunArgs, plan: &Plan, history: &History, output: &Output) {
    let taken = format!(
        "{} rounds took {} of {} runs and {:.0} % of the grid's FLOPs",
        history.rounds.len(),
        history.runs().count(),
        plan.runs.len(),
        100.0 * history.flops() / plan.total_flops()
    );
    match args.options.until {
        Some(until) if !history.is_met(args.options.until) => {
            output.warn(&format!("{taken}; the interval is wider than --until {until}"));
        }
        _ => output.note(&taken),
    }
}

// Notes before and after a round.

/// The expected cost of a round.
fn price(plan: &Plan, history: &History, records: Vec<RunRecord>) -> String {
    let (number, total) = (history.rounds.len(), plan.total_flops());
    let Some(round) = history.rounds.last() else { return String::new() };
    let rate = flops_per_second(records);
    let of_a_core = |rate: f64| format!(", {} of a core", time(round.flops / rate / 3600.0));
    let hours = rate.map_or_else(String::new, of_a_core);
    format!(
        "round {number}: {} runs, {:.2e} FLOPs{hours}; {:.0} % of the grid so far",
        round.runs.len(),
        round.flops,
        100.0 * history.flops() / total
    )
}

/// The prediction after a round, in a sentence.
fn said(number: usize, known: &AfterRound) -> String {
    let (Some(loss), Some([low, high])) = (known.loss_normalised, known.loss_ci95) else {
        return format!("round {number}: no prediction yet");
    };
    let budget = known.budget_flops;
    let width = known.half_width().map(|width| format!("±{:.1} %", 100.0 * width));
    let width = width.unwrap_or_else(|| "no forecast tested yet".to_string());
    format!("round {number}: L_u at {budget:e} is {loss:.3} ({low:.3} to {high:.3}), {width}")
}

// The runs of the next round, out of the grid's.

/// The least fraction of the grid's FLOPs for a round, once windows grow.
const SHARE: f64 = 0.03;

/// The runs of the next round, by id, given the `records` of earlier ones; empty once the grid is trained.
fn next(
    whole: &OpenSweep,
    records: &[RunRecord],
    history: &History,
    budget_flops: f64,
) -> Vec<String> {
    let (points, _) = points(records, whole.sweep.flops.rule);
    let (taken, states): (HashSet<&str>, _) = (history.runs().collect(), whole.folder.run_states());
    let is_open = |run: &&PlannedRun| {
        !taken.contains(run.run_id.as_str()) && states.of(&run.run_id) != JobState::Failed
    };
    let open: Vec<&PlannedRun> = whole.plan.runs.iter().filter(is_open).collect();
    let offered: Vec<OpenRun> = open.iter().map(|run| offer(&whole.plan, run)).collect();
    let spend_flops = SHARE * whole.plan.total_flops();
    let chosen = next_runs(&points, &offered, DesignGoal { budget_flops, spend_flops });
    chosen.into_iter().map(|i| open[i].run_id.clone()).collect()
}

fn offer(plan: &Plan, run: &PlannedRun) -> OpenRun {
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

// `rounds.json`: the runs of each round, and the prediction after it.

const FILE: &str = "rounds.json";

/// The rounds of a sweep so far.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
struct History {
    pub rounds: Vec<Round>,
}

/// Some runs of the grid, trained together.
#[derive(Clone, Debug, Deserialize, Serialize)]
struct Round {
    pub runs: Vec<String>,
    /// Their cost, in FLOPs of their budgets.
    pub flops: f64,
    /// The prediction after them; absent before they are trained.
    pub known: Option<AfterRound>,
}

/// The prediction that rounds narrow.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
struct AfterRound {
    /// The budget that is predicted.
    pub budget_flops: f64,
    /// L_u and its 95 % interval; absent if there are no laws yet.
    pub loss_normalised: Option<f64>,
    pub loss_ci95: Option<[f64; 2]>,
    /// Whether forecasts of the laws were tested on larger budgets of the sweep. Before that, an
    /// interval rests on run noise and on the typical error of a law.
    pub is_tested: bool,
}

impl AfterRound {
    /// Half the interval over the loss; `None` before the laws are tested.
    pub fn half_width(&self) -> Option<f64> {
        let ([low, high], loss) = (self.loss_ci95?, self.loss_normalised?);
        self.is_tested.then(|| 0.5 * (high - low) / loss.abs())
    }
}

impl History {
    /// The rounds in a folder. If it has runs but no rounds, the runs are the first round.
    ///
    /// # Errors
    /// A damaged file, and rounds of another grid.
    pub fn read(folder: &ResultsFolder, plan: &Plan) -> Result<Self> {
        let path = folder.file(FILE);
        let Some(history) = read_if_there::<Self>(&path)? else {
            let states = folder.run_states();
            let is_done = |id: &&String| states.of(id) == JobState::Done;
            let done: Vec<String> =
                plan.runs.iter().map(|run| &run.run_id).filter(is_done).cloned().collect();
            let rounds = if done.is_empty() { Vec::new() } else { vec![Round::of(done, plan)] };
            return Ok(Self { rounds });
        };
        let planned: HashSet<&str> = plan.runs.iter().map(|run| run.run_id.as_str()).collect();
        let strange = history.runs().filter(|id| !planned.contains(id)).count();
        if strange > 0 {
            bail!(
                "{} has {strange} runs that this sweep does not plan: its grid, data or training were \
                 changed since; remove the file, and what is trained already counts as the first round",
                path.display()
            );
        }
        Ok(history)
    }

    pub fn write(&self, folder: &ResultsFolder) -> Result<()> {
        Ok(atomic::write_json(&folder.file(FILE), self)?)
    }

    /// The runs of all rounds, by id.
    pub fn runs(&self) -> impl Iterator<Item = &str> {
        self.rounds.iter().flat_map(|round| &round.runs).map(String::as_str)
    }

    /// Whether the last round is finished and its interval narrow enough.
    pub fn is_met(&self, until: Option<f64>) -> bool {
        let width = self.rounds.last().and_then(|round| round.known?.half_width());
        until.zip(width).is_some_and(|(until, width)| width <= until)
    }

    /// Whether a round is unfinished.
    pub fn is_open(&self) -> bool {
        self.rounds.last().is_some_and(|round| round.known.is_none())
    }

    pub fn flops(&self) -> f64 {
        self.rounds.iter().map(|round| round.flops).sum()
    }
}

impl Round {
    /// An unfinished round.
    pub fn of(runs: Vec<String>, plan: &Plan) -> Self {
        let own: HashSet<&str> = runs.iter().map(String::as_str).collect();
        let planned = plan.runs.iter().filter(|run| own.contains(run.run_id.as_str()));
        let flops = planned.map(|run| run.spec.budget_flops).sum();
        Self { flops, runs, known: None }
    }
}
