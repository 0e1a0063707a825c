//! A setting of rate, batch and schedule at a cell, and the loss that came of it.

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

/// Rate and batch as multiples of what the sweep's own rules say, and the schedule.
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

    /// The training section of a sweep under this setting. No rate is held under a bound, and nothing is
    /// shared: each trial is a run of its own.
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

/// What a rate of so many factors of √2 is multiplied by.
pub(super) fn rate_factor(rate: i32) -> f64 {
    2f64.powf(f64::from(rate) / 2.0)
}

/// What came of a setting at a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Which of the cells.
    pub cell: usize,
    pub setting: Setting,
    /// L_u in nats; none where the run diverged, or the budget does not bear the setting.
    pub loss: Option<f64>,
}

impl Trial {
    /// The loss, above all others where there is none.
    pub fn height(&self) -> f64 {
        self.loss.unwrap_or(f64::INFINITY)
    }
}
