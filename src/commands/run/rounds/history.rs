//! `rounds.json`: which runs each round took, and what was known after it.

use anyhow::{Result, bail};
use isoflop::files::{atomic, read_if_there};
use isoflop::jobs::{JobState, ResultsFolder};
use isoflop::plan::Plan;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;

const FILE: &str = "rounds.json";

/// The rounds of a sweep so far.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct History {
    pub rounds: Vec<Round>,
}

/// Some runs of the grid, trained together.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Round {
    pub runs: Vec<String>,
    /// What they cost, in FLOPs of their budgets.
    pub flops: f64,
    /// After them; absent before they are trained.
    pub known: Option<AfterRound>,
}

/// The prediction that rounds sharpen.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub struct AfterRound {
    /// The budget that is predicted.
    pub budget_flops: f64,
    /// L_u and its 95 % interval; absent where the runs tell no laws yet.
    pub loss_normalised: Option<f64>,
    pub loss_ci95: Option<[f64; 2]>,
    /// Whether forecasts of the laws were tested by larger budgets of the sweep. Before that an
    /// interval rests on the noise of the runs and on what is expected of any law.
    pub is_tested: bool,
}

impl AfterRound {
    /// Half the interval over the loss; none before it is tested.
    pub fn half_width(&self) -> Option<f64> {
        let ([low, high], loss) = (self.loss_ci95?, self.loss_normalised?);
        self.is_tested.then(|| 0.5 * (high - low) / loss.abs())
    }
}

impl History {
    /// What a folder holds. Where it holds runs and no rounds, those runs are the first.
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

    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, folder: &ResultsFolder) -> Result<()> {
        Ok(atomic::write_json(&folder.file(FILE), self)?)
    }

    /// The runs of all rounds, by id.
    pub fn runs(&self) -> impl Iterator<Item = &str> {
        self.rounds.iter().flat_map(|round| &round.runs).map(String::as_str)
    }

    /// What was known after the last round, if that is over.
    pub fn known(&self) -> Option<&AfterRound> {
        self.rounds.last()?.known.as_ref()
    }

    /// Whether a round is begun and not over.
    pub fn is_open(&self) -> bool {
        self.rounds.last().is_some_and(|round| round.known.is_none())
    }

    pub fn flops(&self) -> f64 {
        self.rounds.iter().map(|round| round.flops).sum()
    }
}

impl Round {
    /// A round that is not over.
    pub fn of(runs: Vec<String>, plan: &Plan) -> Self {
        let own: HashSet<&str> = runs.iter().map(String::as_str).collect();
        let planned = plan.runs.iter().filter(|run| own.contains(run.run_id.as_str()));
        let flops = planned.map(|run| run.spec.budget_flops).sum();
        Self { flops, runs, known: None }
    }
}
