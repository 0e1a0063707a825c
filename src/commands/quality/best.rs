//! The best run of each budget, by loss and by the motions that it makes.

use std::collections::BTreeMap;

use isoflop::record::Quality;
use serde::Serialize;

/// The best runs of a generator at a budget.
#[derive(Clone, Debug, Serialize)]
pub struct Best {
    pub generator: String,
    pub budget_flops: f64,
    pub by_loss: Cell,
    pub by_fid: Cell,
}

/// A scored run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cell {
    pub params_nonvocab: usize,
    pub n_vocab: usize,
    pub loss_normalised: f64,
    pub fid: f64,
}

/// Of each generator and budget, by generator, then budget.
pub fn best(rows: &[Quality]) -> Vec<Best> {
    let mut cells: BTreeMap<(&str, u64), Vec<Cell>> = BTreeMap::new();
    for row in rows {
        let budget = row.run.planned.budget_flops;
        if let Some(cell) = Cell::of(row) {
            // Budgets are positive: their bits are ordered as they are.
            cells.entry((row.generator(), budget.to_bits())).or_default().push(cell);
        }
    }
    let least = |cells: &[Cell], of: fn(&Cell) -> f64| {
        cells.iter().min_by(|a, b| of(a).total_cmp(&of(b))).expect("a cell of each").clone()
    };
    let best = |((generator, budget), cells): ((&str, u64), Vec<Cell>)| Best {
        generator: generator.to_string(),
        budget_flops: f64::from_bits(budget),
        by_loss: least(&cells, |cell| cell.loss_normalised),
        by_fid: least(&cells, |cell| cell.fid),
    };
    cells.into_iter().map(best).collect()
}

impl Cell {
    fn of(row: &Quality) -> Option<Self> {
        let planned = &row.run.planned;
        Some(Self {
            params_nonvocab: planned.params_nonvocab,
            n_vocab: planned.n_vocab,
            loss_normalised: row.run.loss_normalised().ok()?,
            fid: row.mean("fid")?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoflop::record::{Measured, Metrics, Planned, RunRecord};
    use isoflop::scores::Repeated;

    fn row(budget_flops: f64, n_vocab: usize, loss: f64, fid: f64) -> Quality {
        let generator = Some("masked".to_string());
        let planned = Planned { budget_flops, n_vocab, generator, ..Planned::default() };
        let metrics: Metrics = [("loss_normalised", loss)].into_iter().collect();
        let fid = Repeated { mean: fid, half_width: 0.0, repeats: 2 };
        Quality {
            run: RunRecord::new(planned, Measured::default(), metrics),
            evaluator_id: String::new(),
            guidance: 0.0,
            scores: vec![("fid", Some(fid))],
        }
    }

    #[test]
    fn the_best_by_loss_need_not_be_the_best_by_fid() {
        let rows = [row(1e9, 16, -1.0, 0.5), row(1e9, 64, -2.0, 0.7), row(1e10, 16, -3.0, 0.1)];
        let best = best(&rows);
        let of = |best: &Best| (best.budget_flops, best.by_loss.n_vocab, best.by_fid.n_vocab);
        assert_eq!(best.iter().map(of).collect::<Vec<_>>(), [(1e9, 64, 16), (1e10, 16, 16)]);
    }
}
