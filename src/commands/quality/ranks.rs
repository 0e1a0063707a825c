//! [`Ranks`]: whether loss orders runs as their motions do.

use std::collections::BTreeMap;

use isoflop::record::Quality;
use isoflop::scores::{RankCorrelation, rank_correlation};
use serde::Serialize;

/// How far the loss orders the runs of a generator as their motions do. Losses of different generators
/// are not put beside one another: that of a masked one is a bound.
#[derive(Serialize)]
pub struct Ranks {
    pub generator: String,
    /// `None` below five runs.
    pub fid: Option<RankCorrelation>,
    pub r_precision_1: Option<RankCorrelation>,
}

impl Ranks {
    /// Those of each generator.
    pub fn of(rows: &[Quality]) -> Vec<Self> {
        let mut by_generator: BTreeMap<&str, Vec<&Quality>> = BTreeMap::new();
        rows.iter().for_each(|row| by_generator.entry(row.generator()).or_default().push(row));
        let ranks = |(generator, own): (&str, Vec<&Quality>)| Self {
            generator: generator.to_string(),
            fid: with_loss(&own, "fid"),
            r_precision_1: with_loss(&own, "r_precision_1"),
        };
        by_generator.into_iter().map(ranks).collect()
    }
}

fn with_loss(rows: &[&Quality], name: &str) -> Option<RankCorrelation> {
    let pair = |row: &&Quality| Some((row.run.loss_normalised().ok()?, row.mean(name)?));
    rank_correlation(&rows.iter().filter_map(pair).collect::<Vec<_>>()).ok()
}
