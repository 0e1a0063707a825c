//! [`Agreement`]: whether another evaluator orders runs as the sweep's does.

use std::collections::HashMap;

use isoflop::record::Quality;
use serde::Serialize;

use super::ranks::Ranks;

/// How far two evaluators order the runs alike that both scored.
#[derive(Serialize)]
pub struct Agreement {
    pub evaluator_id: String,
    #[serde(flatten)]
    pub ranks: Ranks,
}

impl Agreement {
    /// With each other evaluator that scored five of the runs or more.
    pub fn of(own: &[Quality], by_others: &[Vec<Quality>]) -> Vec<Self> {
        by_others.iter().filter_map(|others| Self::with(own, others)).collect()
    }

    fn with(own: &[Quality], others: &[Quality]) -> Option<Self> {
        let evaluator_id = others.first()?.evaluator_id.clone();
        let by_run: HashMap<&str, &Quality> =
            others.iter().map(|row| (row.run.planned.run_id.as_str(), row)).collect();
        let pair = |row: &Quality, name: &str| {
            let other = by_run.get(row.run.planned.run_id.as_str())?;
            Some((row.mean(name)?, other.mean(name)?))
        };
        let ranks = Ranks::of(|name| own.iter().filter_map(|row| pair(row, name)).collect());
        let is_known = ranks.fid.is_some() && ranks.r_precision_1.is_some();
        is_known.then_some(Self { evaluator_id, ranks })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoflop::record::{Measured, Metrics, Planned, RunRecord};
    use isoflop::scores::Repeated;

    fn rows(evaluator_id: &str, fids: &[f64]) -> Vec<Quality> {
        let row = |(run, fid): (usize, &f64)| {
            let planned = Planned { run_id: format!("run {run}"), ..Planned::default() };
            let score = |mean: f64| Some(Repeated { mean, half_width: 0.0, repeats: 2 });
            Quality {
                run: RunRecord::new(planned, Measured::default(), Metrics::default()),
                evaluator_id: evaluator_id.to_string(),
                guidance: 0.0,
                scores: vec![("fid", score(*fid)), ("r_precision_1", score(-fid))],
            }
        };
        fids.iter().enumerate().map(row).collect()
    }

    #[test]
    fn evaluators_agree_where_they_order_runs_alike() {
        let own = rows("own", &[1.0, 2.0, 3.0, 4.0, 5.0, 9.0]);
        let alike = rows("alike", &[10.0, 20.0, 30.0, 40.0, 50.0]);
        let contrary = rows("contrary", &[5.0, 4.0, 3.0, 2.0, 1.0]);
        let few = rows("few", &[1.0, 2.0, 3.0, 4.0]);
        let found = Agreement::of(&own, &[alike, contrary, few]);
        let told = |one: &Agreement| {
            let fid = one.ranks.fid.expect("five runs");
            (one.evaluator_id.clone(), fid.value, fid.n)
        };
        let told: Vec<(String, f64, usize)> = found.iter().map(told).collect();
        assert_eq!(told, [("alike".to_string(), 1.0, 5), ("contrary".to_string(), -1.0, 5)]);
        assert_eq!(found[1].ranks.r_precision_1.map(|rank| rank.value), Some(-1.0));
    }
}
