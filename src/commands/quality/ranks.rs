//! [`Ranks`]: whether runs are ordered alike by two measures.

use std::collections::BTreeMap;

use isoflop::record::Quality;
use isoflop::scores::{RankCorrelation, rank_correlation};
use serde::Serialize;

/// How far two measures order runs alike, of FID and of R@1; `None` below five runs.
#[derive(Serialize)]
pub struct Ranks {
    pub fid: Option<RankCorrelation>,
    pub r_precision_1: Option<RankCorrelation>,
}

impl Ranks {
    /// Of the pairs of values that runs have by the name of a score.
    pub fn of(pairs: impl Fn(&str) -> Vec<(f64, f64)>) -> Self {
        let rank = |name: &str| rank_correlation(&pairs(name)).ok();
        Self { fid: rank("fid"), r_precision_1: rank("r_precision_1") }
    }
}

/// How far the loss orders the runs of a generator as their motions do. Losses of different generators
/// are not put beside one another: that of a masked one is a bound.
#[derive(Serialize)]
pub struct LossRanks {
    pub generator: String,
    #[serde(flatten)]
    pub ranks: Ranks,
}

impl LossRanks {
    /// Those of each generator.
    pub fn of(rows: &[Quality]) -> Vec<Self> {
        let mut by_generator: BTreeMap<&str, Vec<&Quality>> = BTreeMap::new();
        rows.iter().for_each(|row| by_generator.entry(row.generator()).or_default().push(row));
        let ranks = |(generator, own): (&str, Vec<&Quality>)| {
            let pair = |row: &Quality, name: &str| {
                Some((row.run.loss_normalised().ok()?, row.mean(name)?))
            };
            let pairs = |name: &str| own.iter().filter_map(|row| pair(row, name)).collect();
            Self { generator: generator.to_string(), ranks: Ranks::of(pairs) }
        };
        by_generator.into_iter().map(ranks).collect()
    }
}
