//! `record.json` as it may lie on the disk: in the format of today, or in an older one.
//!
//! | format | layout |
//! | --- | --- |
//! | 1 | every fact and metric side by side, no `format` |
//! | 2 | `format`, `planned`, `measured`, `metrics` |
//!
//! A key that nobody knows is passed over, so a newer build's record is read too.

use serde::Deserialize;
use serde::de::Error;
use serde_json::{Map, Value};

use super::facts::{LOSSES, Measured, Planned};
use super::metrics::Metrics;
use super::run_record::RunRecord;

/// The file of either format.
#[derive(Deserialize)]
pub(super) struct Stored {
    #[serde(default = "first")]
    format: u32,
    planned: Option<Planned>,
    measured: Option<Measured>,
    metrics: Option<Metrics>,
    /// What format 1 has beside `format`.
    #[serde(flatten)]
    rest: Map<String, Value>,
}

fn first() -> u32 {
    1
}

impl TryFrom<Stored> for RunRecord {
    type Error = serde_json::Error;

    fn try_from(stored: Stored) -> Result<Self, Self::Error> {
        let record = match stored.format {
            0 | 1 => flat(&stored.rest)?,
            _ => nested(stored)?,
        };
        if !record.metrics.have_a_loss() {
            return Err(Self::Error::custom(format!("none of the losses {}", LOSSES.join(", "))));
        }
        Ok(record)
    }
}

fn flat(facts: &Map<String, Value>) -> Result<RunRecord, serde_json::Error> {
    let loss = |name: &&'static str| Some((*name, facts.get(*name)?.as_f64()?));
    let metrics = LOSSES.iter().filter_map(loss).collect();
    Ok(RunRecord::new(Planned::deserialize(facts)?, Measured::deserialize(facts)?, metrics))
}

fn nested(stored: Stored) -> Result<RunRecord, serde_json::Error> {
    let missing = serde_json::Error::missing_field;
    let planned = stored.planned.ok_or_else(|| missing("planned"))?;
    let measured = stored.measured.ok_or_else(|| missing("measured"))?;
    Ok(RunRecord::new(planned, measured, stored.metrics.ok_or_else(|| missing("metrics"))?))
}
