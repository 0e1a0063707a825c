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

impl TryFrom<Map<String, Value>> for RunRecord {
    type Error = serde_json::Error;

    fn try_from(file: Map<String, Value>) -> Result<Self, Self::Error> {
        let record = match file.get("format").and_then(Value::as_u64) {
            None | Some(0 | 1) => flat(&file)?,
            Some(_) => nested(&file)?,
        };
        if !record.metrics.have_a_loss() {
            return Err(Self::Error::custom(format!("none of the losses {}", LOSSES.join(", "))));
        }
        Ok(record)
    }
}

/// The record of facts and losses side by side, as a row of the table has them.
pub(super) fn flat(facts: &Map<String, Value>) -> Result<RunRecord, serde_json::Error> {
    let loss = |name: &&'static str| Some((*name, facts.get(*name)?.as_f64()?));
    let metrics = LOSSES.iter().filter_map(loss).collect();
    Ok(RunRecord::new(Planned::deserialize(facts)?, Measured::deserialize(facts)?, metrics))
}

fn nested(file: &Map<String, Value>) -> Result<RunRecord, serde_json::Error> {
    let group = |name| file.get(name).ok_or_else(|| serde_json::Error::missing_field(name));
    let planned = Planned::deserialize(group("planned")?)?;
    let measured = Measured::deserialize(group("measured")?)?;
    Ok(RunRecord::new(planned, measured, Metrics::deserialize(group("metrics")?)?))
}
