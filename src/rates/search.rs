//! Settings of rate, batch and schedule at a cell, their results, and the next settings.

use serde::{Deserialize, Serialize};

use crate::sweep::{ScheduleKind, TrainSection};

/// A cell that rates are tried at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    pub budget_flops: f64,
    /// N_nv.
    pub params_nonvocab: f64,
    /// V.
    pub n_vocab: f64,
    /// D.
    pub tokens: f64,
    /// The peak rate by the sweep's own rule.
    pub lr: f64,
}

/// Rate and batch as multiples of the sweep's rules, and the schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Setting {
    /// Factors of √2.
    pub rate: i32,
    /// Factors of 2.
    pub batch: i32,
    pub schedule: ScheduleKind,
}

impl Setting {
    /// The sweep's own.
    pub fn own(schedule: ScheduleKind) -> Self {
        Self { rate: 0, batch: 0, schedule }
    }

    /// The training section of a sweep under this setting, without bounds on the rate and without shared trunks.
    pub fn of(self, train: &TrainSection) -> TrainSection {
        let mut own = train.clone();
        own.lr.coefficient *= rate_factor(self.rate);
        own.lr.max = f64::MAX;
        own.batch.coefficient *= 2f64.powi(self.batch);
        let moved = |bound: usize| (bound as f64 * 2f64.powi(self.batch)).round().max(1.0) as usize;
        (own.batch.min, own.batch.max) = (moved(own.batch.min), moved(own.batch.max));
        own.schedule.kind = self.schedule;
        own.schedule.share = false;
        own
    }
}

/// The factor of a rate, from its number of factors of √2.
pub(super) fn rate_factor(rate: i32) -> f64 {
    2f64.powf(f64::from(rate) / 2.0)
}

/// The result of a setting at a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The index of the cell.
    pub cell: usize,
    pub setting: Setting,
    /// L_u in nats; `None` if the run diverged, or the budget buys too few steps.
    pub loss: Option<f64>,
}

impl Trial {
    /// The loss; infinite if there is none.
    pub fn height(&self) -> f64 {
        self.loss.unwrap_or(f64::INFINITY)
    }
}

/// Factors of √2 between two rates that are tried.
const STEP: i32 = 2;
/// Factors of √2 beyond which no rate is tried, and factors of 2 beyond which no batch is.
const FARTHEST_RATE: i32 = 10;
const FARTHEST_BATCH: i32 = 3;

/// The next trials at `n_cells` cells, (cell, setting); none if the search is over.
///
/// First the rates of each cell, a factor of 2 apart, until the best has a worse one on both sides. Then
/// batches, each cell's rate moved by √2 for each factor of 2 (Malladi et al. 2022), until the best of all
/// cells together lies between worse ones. Then the other schedule.
pub fn next(n_cells: usize, own: ScheduleKind, trials: &[Trial]) -> Vec<(usize, Setting)> {
    let cells = Cell::all(n_cells, own, trials);
    let rates: Vec<_> = cells.iter().flat_map(Cell::next_rates).collect();
    if !rates.is_empty() {
        return rates;
    }
    let batches = next_batches(&cells);
    if !batches.is_empty() {
        return batches;
    }
    let batch = best_batch(&cells);
    let with_other =
        |cell: &Cell| cell.open(Setting { schedule: other(own), ..cell.at_batch(batch)? });
    cells.iter().filter_map(with_other).collect()
}

/// The batch whose trials are best on average over the cells.
pub(super) fn best_batch(cells: &[Cell]) -> i32 {
    let (low, high) = tried(cells);
    let mean = |batch: i32| {
        let gains: Vec<f64> = cells.iter().filter_map(|cell| cell.gain_of_batch(batch)).collect();
        if gains.is_empty() {
            f64::INFINITY
        } else {
            gains.iter().sum::<f64>() / gains.len() as f64
        }
    };
    (low..=high).min_by(|a, b| mean(*a).total_cmp(&mean(*b))).unwrap_or(0)
}

fn next_batches(cells: &[Cell]) -> Vec<(usize, Setting)> {
    let (low, high) = tried(cells);
    let asked = |batch: i32| {
        let at = move |cell: &Cell| cell.open(cell.at_batch(batch)?);
        cells.iter().filter_map(at).collect::<Vec<_>>()
    };
    let first = [asked(-1), asked(1)].concat();
    if !first.is_empty() {
        return first;
    }
    match best_batch(cells) {
        best if best == low && low > -FARTHEST_BATCH => asked(low - 1),
        best if best == high && high < FARTHEST_BATCH => asked(high + 1),
        _ => Vec::new(),
    }
}

/// The smallest and the largest batch that was tried.
fn tried(cells: &[Cell]) -> (i32, i32) {
    let batches = || cells.iter().flat_map(|cell| cell.ended().map(|trial| trial.setting.batch));
    (batches().min().unwrap_or(0), batches().max().unwrap_or(0))
}

/// The schedule that a sweep does not have.
pub(super) fn other(own: ScheduleKind) -> ScheduleKind {
    match own {
        ScheduleKind::Cosine => ScheduleKind::Wsd,
        ScheduleKind::Wsd => ScheduleKind::Cosine,
    }
}

/// The trials of one cell.
pub(super) struct Cell<'a> {
    cell: usize,
    /// The sweep's schedule.
    own: ScheduleKind,
    trials: &'a [Trial],
}

impl<'a> Cell<'a> {
    pub fn all(n_cells: usize, own: ScheduleKind, trials: &'a [Trial]) -> Vec<Self> {
        (0..n_cells).map(|cell| Self { cell, own, trials }).collect()
    }

    fn ended(&self) -> impl Iterator<Item = &'a Trial> {
        let (cell, own) = (self.cell, self.own);
        let is_own = move |t: &&Trial| t.cell == cell && t.setting.schedule == own;
        self.trials.iter().filter(is_own)
    }

    /// (rate, loss) of the trials at the sweep's own batch, ascending.
    pub fn rates(&self) -> Vec<(i32, f64)> {
        let own = self.ended().filter(|trial| trial.setting.batch == 0);
        let mut rates: Vec<(i32, f64)> =
            own.map(|trial| (trial.setting.rate, trial.height())).collect();
        rates.sort_by_key(|(rate, _)| *rate);
        rates
    }

    fn best_rate(&self) -> Option<i32> {
        let best = self.rates().into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        best.1.is_finite().then_some(best.0)
    }

    fn next_rates(&self) -> Vec<(usize, Setting)> {
        // Where nothing ended, the rate is too high.
        let lowest = self.rates().first().map_or(0, |(rate, _)| *rate);
        let middle = self.best_rate().unwrap_or(lowest);
        let wanted = [middle - STEP, middle, middle + STEP].into_iter();
        let near = wanted.filter(|rate| rate.abs() <= FARTHEST_RATE);
        near.filter_map(|rate| self.open(Setting { rate, ..Setting::own(self.own) })).collect()
    }

    /// The best rate, moved with the batch.
    fn at_batch(&self, batch: i32) -> Option<Setting> {
        Some(Setting { rate: self.best_rate()? + batch, batch, schedule: self.own })
    }

    /// The setting, unless it was tried.
    fn open(&self, setting: Setting) -> Option<(usize, Setting)> {
        self.trial(setting).is_none().then_some((self.cell, setting))
    }

    fn trial(&self, setting: Setting) -> Option<&Trial> {
        self.trials.iter().find(|trial| trial.cell == self.cell && trial.setting == setting)
    }

    /// The loss at a batch less that at the sweep's own.
    pub fn gain_of_batch(&self, batch: i32) -> Option<f64> {
        let loss = |batch| self.trial(self.at_batch(batch)?)?.loss;
        Some(loss(batch)? - loss(0)?)
    }

    /// The loss under the other schedule less that under the sweep's own, at a batch.
    pub fn gain_of_schedule(&self, batch: i32) -> Option<f64> {
        let own = self.at_batch(batch)?;
        let with_other = Setting { schedule: other(self.own), ..own };
        Some(self.trial(with_other)?.loss? - self.trial(own)?.loss?)
    }
}
