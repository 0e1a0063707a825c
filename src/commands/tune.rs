//! `isoflop tune`: finds the rule of learning rate and batch by trials at a few cells of a sweep's grid.

use super::context::{OpenSweep, SweepArgs, an_engine};
use super::prelude::*;
use super::run::{RunArgs, bring, hold, open};
use super::sizes::distinct;
use isoflop::engine::{ENGINES, Engine};
use isoflop::jobs::presence::Held;
use isoflop::jobs::{JobId, JobState, adopt};
use isoflop::plan::{Plan, PlannedRun};
use isoflop::rates::{CellRate, Place, Rule, Setting, Trial, choose, fit_rule, next};
use isoflop::sweep::{LrRule, ScheduleKind};
use std::ops::ControlFlow;

#[derive(Args)]
pub struct TuneArgs {
    #[command(flatten)]
    sweep: SweepArgs,
    /// Cells of the grid (model, vocabulary, budget) at which to try rates
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
    let yaml = yaml(&rule, &part.sweep)?;
    atomic::write_bytes(&part.folder.file("rates.yaml"), yaml.as_bytes())?;
    output.result(&document, &text(&rule, trials.len(), &part.folder))
}

/// Runs trials until none is left. Finished trials are read, not trained.
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
            let new = || asked.iter().filter_map(|asked| asked.run.as_ref());
            let flops: f64 = new().map(|run| run.spec.budget_flops).sum();
            let (n, so_far) = (new().count(), all.len());
            output.note(&format!("{n} trials, {flops:.2e} FLOPs; {so_far} so far"));
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

// The result as text.

/// The best rate of each cell, the rule, and its cost in loss.
fn text(rule: &Rule, n_trials: usize, folder: &ResultsFolder) -> String {
    let heads = ["C", "N_nv", "V", "D", "own lr", "best lr", "L_u", "gain"];
    let mut out = table(heads, rule.cells.iter().map(row));
    out += "\n";
    sentences(rule, n_trials).iter().for_each(|sentence| out += &wrap("- ", sentence));
    out + &format!("\n{}: the rule, as a sweep takes it\n", folder.file("rates.yaml").display())
}

fn row(cell: &CellRate) -> [String; 8] {
    let CellRate { place, optimal_lr, best_loss, own_loss, .. } = cell;
    [
        format!("{:e}", place.budget_flops),
        format!("{:.3e}", place.params_nonvocab),
        place.n_vocab.to_string(),
        format!("{:.2e}", place.tokens),
        format!("{:.4}", place.lr),
        format!("{optimal_lr:.4}"),
        format!("{best_loss:.3}"),
        dash(*own_loss, |own| format!("{:.3}", own - best_loss)),
    ]
}

fn sentences(rule: &Rule, n_trials: usize) -> Vec<String> {
    let nats = |regret: Option<f64>| dash(regret, |x| format!("{x:.3}"));
    let [exponent, error] = rule.vocab_exponent;
    let known = if exponent.abs() > 2.0 * error { "which the rule leaves out" } else { "none" };
    let mut all = vec![
        format!(
            "{n_trials} trials: lr = {}, {} nats above each cell's own best ({} where the cell took no \
             part in the fit); the sweep's own rule is {} above.",
            formula(&rule.lr),
            nats(rule.regret),
            nats(rule.regret_left_out),
            nats(rule.regret_own)
        ),
        format!(
            "At one N_nv and D the best rate goes as V^{exponent:.2} (standard error {error:.2}): {known}."
        ),
    ];
    all.push(match rule.batch_gain {
        Some([gain, error]) => format!(
            "A batch of {} times the sweep's changes L_u by {gain:+.3} nats (standard error {error:.3}).",
            2f64.powi(rule.batch_doublings)
        ),
        None => "No other batch is better than the sweep's.".into(),
    });
    if let Some([gain, error]) = rule.schedule_gain {
        all.push(format!(
            "The other schedule changes L_u by {gain:+.3} nats (standard error {error:.3}): {} is taken.",
            match rule.schedule {
                ScheduleKind::Cosine => "the cosine",
                ScheduleKind::Wsd => "wsd",
            }
        ));
    }
    all
}

fn formula(lr: &LrRule) -> String {
    let LrRule { coefficient, params_exponent, tokens_exponent: of_d, .. } = lr;
    let tokens = if *of_d == 0.0 { String::new() } else { format!(" D^{of_d}") };
    format!("{coefficient} N_nv^{params_exponent}{tokens}")
}

/// The rule, as the `train` section of a sweep.
fn yaml(rule: &Rule, sweep: &Sweep) -> Result<String> {
    let mut schedule = sweep.train.schedule.clone();
    schedule.kind = rule.schedule;
    let section = json!({ "train": { "schedule": schedule, "lr": rule.lr, "batch": rule.batch } });
    let head =
        format!("# Found by `isoflop tune` at {} cells of {}.\n", rule.cells.len(), sweep.name);
    Ok(head + &serde_yaml::to_string(&section)?)
}

// Cells of a plan, and the runs that try settings at them.

/// The cells of the trials.
struct Cells {
    runs: Vec<PlannedRun>,
    pub places: Vec<Place>,
}

impl Cells {
    /// At most `count` cells of a sweep, each with its first seed and tokenizer.
    ///
    /// # Errors
    /// The sweep has a user's trainer, which ignores the settings of `train`.
    pub fn of(open: &OpenSweep, count: usize) -> Result<Self> {
        if open.sweep.trainer.is_some() {
            bail!("`tune` knows the built-in trainer's rates; {} has its own", open.sweep.name);
        }
        let mut runs: Vec<PlannedRun> = Vec::new();
        for run in &open.plan.runs {
            if !runs.iter().rev().any(|other| is_same_cell(other, run)) {
                runs.push(run.clone());
            }
        }
        let places: Vec<Place> = runs.iter().map(|run| place(run, &open.sweep)).collect();
        let chosen = choose(&places, count);
        Ok(Self {
            places: chosen.iter().map(|i| places[*i]).collect(),
            runs: chosen.into_iter().map(|i| runs[i].clone()).collect(),
        })
    }

    /// The runs of some trials, (cell, setting).
    pub fn asked(&self, sweep: &Sweep, plan: &Plan, wanted: Vec<(usize, Setting)>) -> Vec<Asked> {
        // Many cells try one setting, and a large sweep takes a second to plan.
        let settings = distinct(wanted.iter().map(|(_, setting)| *setting).collect());
        let planned = |setting: Setting| {
            let own = Sweep { train: setting.of(&sweep.train), ..sweep.clone() };
            (setting, Plan::new(&own, plan.data.clone()))
        };
        let plans: Vec<(Setting, Plan)> = settings.into_iter().map(planned).collect();
        let of = |(cell, setting): (usize, Setting)| {
            let mut runs = plans.iter().filter(|(planned, _)| *planned == setting);
            let cell_run = &self.runs[cell];
            let is_it = |run: &&PlannedRun| {
                is_same_cell(run, cell_run)
                    && run.spec.seed == cell_run.spec.seed
                    && run.spec.tokenizer_id == cell_run.spec.tokenizer_id
            };
            let run = runs.find_map(|(_, plan)| plan.runs.iter().find(is_it)).cloned();
            Asked { cell, setting, run }
        };
        wanted.into_iter().map(of).collect()
    }
}

fn is_same_cell(a: &PlannedRun, b: &PlannedRun) -> bool {
    let (a, b) = (&a.spec, &b.spec);
    (a.budget_flops, a.share) == (b.budget_flops, b.share)
        && (&a.generator, &a.codes) == (&b.generator, &b.codes)
}

fn place(run: &PlannedRun, sweep: &Sweep) -> Place {
    let unbounded = Setting::own(sweep.train.schedule.kind).of(&sweep.train);
    Place {
        budget_flops: run.spec.budget_flops,
        params_nonvocab: run.params.nonvocab as f64,
        n_vocab: run.spec.n_vocab() as f64,
        tokens: run.spec.tokens() as f64,
        lr: isoflop::plan::learning_rate(&run.params, run.spec.tokens(), &unbounded.lr),
    }
}

/// A trial to run.
#[derive(Clone)]
struct Asked {
    pub cell: usize,
    pub setting: Setting,
    /// `None` if the budget buys too few steps of the setting's batch.
    pub run: Option<PlannedRun>,
}

impl Asked {
    /// Whether it is still to be trained.
    pub fn is_open(&self, folder: &ResultsFolder) -> bool {
        let state = self.run.as_ref().map(|run| folder.state(&JobId::run(&run.run_id)));
        matches!(state, Some(JobState::Missing | JobState::Started))
    }

    /// Its result.
    ///
    /// # Errors
    /// It has no result although it did not fail: a dependency failed.
    pub fn trial(&self, folder: &ResultsFolder) -> Result<Trial> {
        let Self { cell, setting, run } = self;
        let mut trial = Trial { cell: *cell, setting: *setting, loss: None };
        let Some(run) = run else { return Ok(trial) };
        match folder.record(&run.run_id)? {
            Some(record) => trial.loss = Some(record.loss_normalised()?),
            None if folder.state(&JobId::run(&run.run_id)) == JobState::Failed => {}
            None => bail!("{} has no result: a job that it depends on failed", run.spec.label()),
        }
        Ok(trial)
    }
}
