//! [`RunRecord`]: all facts of a finished run, one row of `runs.parquet`.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};

use super::facts::{LOSS_NORMALISED, LOSSES, Measured, Planned, block_metric};
use crate::laws::{IsoFlopPoint, Metric, RunFacts};
use crate::spec::FlopsRule;

/// The format of `record.json` that is written.
pub const FORMAT: u32 = 2;

/// One finished run: specification, cost and results.
///
/// Renamed into place, and only after success. Losses are in nats, times in seconds. A fact that an older build did
/// not write is `None`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Map<String, Value>")]
pub struct RunRecord {
    /// [`FORMAT`], whatever format the record was read from.
    pub format: u32,
    pub planned: Planned,
    pub measured: Measured,
    pub metrics: Metrics,
}

/// A run that lacks a requested fact.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("its record has no {what}")]
pub struct Lacking {
    /// The name of a fact or a metric.
    pub what: String,
}

impl RunRecord {
    /// The record of a run.
    pub fn new(planned: Planned, measured: Measured, metrics: Metrics) -> Self {
        Self { format: FORMAT, planned, measured, metrics }
    }

    /// A row of a table made elsewhere, with its loss as L_u; counts are rounded to whole numbers.
    pub fn of_point(point: &IsoFlopPoint, rule: FlopsRule) -> Self {
        let whole = |x: f64| x.round() as usize;
        let planned = Planned {
            run_id: point.run_id.clone(),
            seed: Some(point.seed),
            n_vocab: whole(point.n_vocab),
            budget_flops: point.budget_flops,
            params_nonvocab: whole(point.params_nonvocab),
            params_vocab: whole(point.params_vocab),
            share: point.about.share,
            ..Planned::default()
        };
        let mut measured = Measured {
            tokens: whole(point.tokens),
            unique_tokens: point.about.unique_tokens.map(whole),
            ..Measured::default()
        };
        *measured.flops_mut(rule) = Some(point.flops);
        Self::new(planned, measured, [(LOSS_NORMALISED, point.loss)].into_iter().collect())
    }

    /// A metric of the run.
    ///
    /// # Errors
    /// The run was not measured so.
    pub fn loss(&self, metric: &str) -> Result<f64, Lacking> {
        self.metrics.get(metric).ok_or_else(|| Lacking { what: metric.to_string() })
    }

    /// L_u, the loss that laws are fitted to by default.
    ///
    /// # Errors
    /// The run was not measured so.
    pub fn loss_normalised(&self) -> Result<f64, Lacking> {
        self.loss(LOSS_NORMALISED)
    }

    /// Training FLOPs achieved, by a rule.
    ///
    /// # Errors
    /// The run has no count by this rule.
    pub fn flops(&self, rule: FlopsRule) -> Result<f64, Lacking> {
        let counted = match rule {
            FlopsRule::OpenAi => self.measured.flops_openai,
            FlopsRule::SixNd => self.measured.flops_6nd,
            FlopsRule::Exact => self.measured.flops_exact,
        };
        counted.ok_or_else(|| Lacking { what: format!("flops_{}", rule.name()) })
    }

    /// The fraction of the training split's clips used, 1 for all.
    pub fn share(&self) -> f64 {
        self.planned.share.unwrap_or(1.0)
    }

    /// L_u on each block of the test split, less their mean; empty if it is not known.
    fn by_block(&self) -> Vec<f64> {
        let losses = (0..).map_while(|block| self.metrics.get(&block_metric(block)));
        let losses: Vec<f64> = losses.collect();
        let mean = losses.iter().sum::<f64>() / losses.len() as f64;
        losses.iter().map(|loss| loss - mean).collect()
    }

    /// The run as the laws see it: its FLOPs counted by a rule, its loss by a metric.
    ///
    /// # Errors
    /// The record lacks one of the two.
    pub fn point(&self, rule: FlopsRule, metric: &Metric) -> Result<IsoFlopPoint, Lacking> {
        let Planned { run_id, seed, budget_flops, params_nonvocab, params_vocab, n_vocab, .. } =
            &self.planned;
        Ok(IsoFlopPoint {
            run_id: run_id.clone(),
            seed: seed.unwrap_or(0),
            budget_flops: *budget_flops,
            flops: self.flops(rule)?,
            params_nonvocab: *params_nonvocab as f64,
            params_vocab: *params_vocab as f64,
            n_vocab: *n_vocab as f64,
            tokens: self.measured.tokens as f64,
            metric: metric.clone(),
            loss: self.loss(metric.name())?,
            weight: 1.0,
            about: RunFacts {
                n_layer: self.planned.n_layer,
                tokenizer: self.planned.tokenizer_id.clone(),
                // 0 if a user's trainer does not report it.
                unique_tokens: self.measured.unique_tokens.filter(|n| *n > 0).map(|n| n as f64),
                share: self.planned.share,
                by_block: if metric.name() == LOSS_NORMALISED {
                    self.by_block()
                } else {
                    Vec::new()
                },
            },
        })
    }
}

/// FLOPs of their budgets that runs spent a second, one at a time; `None` if that is no rate. Runs
/// whose time is not known are left out.
pub fn flops_per_second(records: impl IntoIterator<Item = RunRecord>) -> Option<f64> {
    let (mut flops, mut seconds) = (0.0, 0.0);
    for record in records {
        let Some(wall_s) = record.measured.wall_s else { continue };
        flops += record.planned.budget_flops;
        seconds += wall_s;
    }
    Some(flops / seconds).filter(|rate| rate.is_finite() && *rate > 0.0)
}

/// The results of a run by name. Undeclared metrics are kept too.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Metrics(BTreeMap<Cow<'static, str>, f64>);

impl Metrics {
    /// The value of a metric; `None` if the run was not measured so.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    /// Adds a metric, or replaces it.
    pub fn set(&mut self, name: impl Into<Cow<'static, str>>, value: f64) {
        self.0.insert(name.into(), value);
    }

    /// Every metric, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(name, value)| (name.as_ref(), *value))
    }

    /// Whether a loss is among them.
    pub(super) fn have_a_loss(&self) -> bool {
        LOSSES.iter().any(|name| self.0.contains_key(*name))
    }
}

impl<N: Into<Cow<'static, str>>> FromIterator<(N, f64)> for Metrics {
    fn from_iter<I: IntoIterator<Item = (N, f64)>>(metrics: I) -> Self {
        Self(metrics.into_iter().map(|(name, value)| (name.into(), value)).collect())
    }
}

impl<'de> Deserialize<'de> for Metrics {
    /// A null is a metric that was not measured.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let metrics = BTreeMap::<String, Option<f64>>::deserialize(deserializer)?;
        Ok(metrics.into_iter().filter_map(|(name, value)| Some((name, value?))).collect())
    }
}

/// `record.json` on the disk, in the current or an older format.
///
/// | format | layout |
/// | --- | --- |
/// | 1 | all facts and metrics on one level, no `format` |
/// | 2 | `format`, `planned`, `measured`, `metrics` |
///
/// Unknown keys are ignored, so records of newer builds can be read.
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
