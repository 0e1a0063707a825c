//! Cells of a plan, and the runs that try settings at them.

use anyhow::{Result, bail};
use isoflop::jobs::{JobId, JobState, ResultsFolder};
use isoflop::plan::{Plan, PlannedRun};
use isoflop::rates::{Place, Setting, Trial, choose};
use isoflop::sweep::Sweep;

use crate::commands::context::OpenSweep;

/// The cells that rates are tried at.
pub struct Cells {
    runs: Vec<PlannedRun>,
    pub places: Vec<Place>,
}

impl Cells {
    /// At most `count` cells of a sweep, each with its first seed and tokenizer.
    ///
    /// # Errors
    /// The sweep's trainer is a program of its own, which the settings of `train` do not reach.
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
        let mut plans: Vec<(Setting, Plan)> = Vec::new();
        for (_, setting) in &wanted {
            if !plans.iter().any(|(planned, _)| planned == setting) {
                let train = setting.of(&sweep.train);
                let own = Sweep { train, ..sweep.clone() };
                plans.push((*setting, Plan::new(&own, plan.data.clone())));
            }
        }
        let of = |(cell, setting): (usize, Setting)| {
            let mut runs = plans.iter().filter(|(planned, _)| *planned == setting);
            let cell_run = &self.runs[cell];
            let is_it = |run: &&PlannedRun| {
                is_same_cell(run, cell_run)
                    && run.spec.seed == cell_run.spec.seed
                    && run.spec.tokenizer_id == cell_run.spec.tokenizer_id
            };
            Asked {
                cell,
                setting,
                run: runs.find_map(|(_, plan)| plan.runs.iter().find(is_it)).cloned(),
            }
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

/// A trial that is to be made.
#[derive(Clone)]
pub struct Asked {
    pub cell: usize,
    pub setting: Setting,
    /// None where the budget does not bear the setting: too few steps of its batch.
    pub run: Option<PlannedRun>,
}

impl Asked {
    /// Whether it is still to be trained.
    pub fn is_open(&self, folder: &ResultsFolder) -> bool {
        let state = self.run.as_ref().map(|run| folder.state(&JobId::run(&run.run_id)));
        matches!(state, Some(JobState::Missing | JobState::Started))
    }

    /// What came of it.
    ///
    /// # Errors
    /// It has no result, and did not fail either: what it needs is lost.
    pub fn trial(&self, folder: &ResultsFolder) -> Result<Trial> {
        let Self { cell, setting, run } = self;
        let mut trial = Trial { cell: *cell, setting: *setting, loss: None };
        let Some(run) = run else { return Ok(trial) };
        match folder.record(&run.run_id)? {
            Some(record) => trial.loss = Some(record.loss_normalised()?),
            None if folder.state(&JobId::run(&run.run_id)) == JobState::Failed => {}
            None => bail!("{} has no result: what it needs failed", run.spec.label()),
        }
        Ok(trial)
    }
}
