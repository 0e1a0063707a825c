//! The best run of each budget, by loss and by the motions that it makes.

use std::collections::BTreeMap;

use isoflop::laws::{FloorLaw, floor_law};
use isoflop::record::Quality;
use serde::Serialize;

/// Budgets that a law with three numbers needs at least, so that one is left to misfit.
const LEAST_BUDGETS: usize = 4;

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

/// How the best FID of a generator falls with compute.
#[derive(Clone, Debug, Serialize)]
pub struct FidLaw {
    pub generator: String,
    /// C0: FID = floor + coefficient (C / C0)^−exponent.
    pub reference_flops: f64,
    pub law: FloorLaw,
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

/// A law with a floor for the best FID of each generator that has four budgets or more, where FID falls
/// and the data show a floor.
pub fn fid_laws(best: &[Best]) -> Vec<FidLaw> {
    let mut by_generator: BTreeMap<&str, Vec<&Best>> = BTreeMap::new();
    best.iter().for_each(|best| by_generator.entry(&best.generator).or_default().push(best));
    let law = |(generator, own): (&str, Vec<&Best>)| {
        let compute: Vec<f64> = own.iter().map(|best| best.budget_flops).collect();
        let fid: Vec<f64> = own.iter().map(|best| best.by_fid.fid).collect();
        let reference_flops = *compute.first().filter(|_| compute.len() >= LEAST_BUDGETS)?;
        let law = floor_law(&compute, &fid, reference_flops).filter(|law| !law.is_at_bound())?;
        Some(FidLaw { generator: generator.to_string(), reference_flops, law })
    };
    by_generator.into_iter().filter_map(law).collect()
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

    #[test]
    fn a_law_with_a_floor_is_found_where_there_is_one() {
        let at = |budget: f64| row(budget, 16, -1.0, 0.05 + 0.4 * (budget / 1e9).powf(-0.5));
        let rows: Vec<Quality> = [1e9, 1e10, 1e11, 1e12].map(at).to_vec();
        let laws = fid_laws(&best(&rows));
        let FloorLaw { floor, coefficient, exponent, .. } = laws[0].law;
        let found = [floor, coefficient, exponent];
        assert!(found.iter().zip([0.05, 0.4, 0.5]).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
        assert!(fid_laws(&best(&rows[..3])).is_empty(), "three numbers fit three budgets");
    }
}
