//! The runs of a sweep as the figures see them: cells of model × vocabulary × budget.

use std::collections::BTreeMap;

use super::ticks::count;
use crate::record::RunRecord;

/// A model's shape; models are ordered by size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Model {
    pub params_nonvocab: usize,
    pub n_layer: usize,
    pub n_head: usize,
    pub d_model: usize,
    pub d_ff: usize,
}

impl Model {
    fn of(run: &RunRecord) -> Model {
        let RunRecord { params_nonvocab, n_layer, n_head, d_model, d_ff, .. } = *run;
        Model { params_nonvocab, n_layer, n_head, d_model, d_ff }
    }

    /// Size, layers, heads, width: `790k (4L 4H 128d)`.
    pub fn label(&self) -> String {
        let Model { n_layer, n_head, d_model, .. } = self;
        format!("{} ({n_layer}L {n_head}H {d_model}d)", count(self.params_nonvocab as f64))
    }
}

/// The runs of one model, vocabulary and budget, averaged over seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    pub model: Model,
    pub n_vocab: usize,
    pub budget_flops: f64,
    /// Spent, under the rule of the figure.
    pub flops: f64,
    /// L_u, in nats.
    pub loss_normalised: f64,
    pub seeds: usize,
}

/// Every cell of a sweep, with the sorted values of each axis of the grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    pub cells: Vec<Cell>,
    pub models: Vec<Model>,
    pub vocabs: Vec<usize>,
    pub budgets: Vec<f64>,
}

impl Cells {
    /// Groups the runs whose L_u is finite; `flops` says what a run spent.
    pub fn of(records: &[RunRecord], flops: Flops) -> Cells {
        let mut groups: BTreeMap<_, Vec<&RunRecord>> = BTreeMap::new();
        for run in records.iter().filter(|run| run.loss_normalised.is_finite()) {
            let key = (Model::of(run), run.n_vocab, run.budget_flops.to_bits());
            groups.entry(key).or_default().push(run);
        }
        Cells::gather(groups.into_values().map(|runs| cell(&runs, flops)).collect())
    }

    fn gather(cells: Vec<Cell>) -> Cells {
        let models = sorted(cells.iter().map(|cell| cell.model));
        let vocabs = sorted(cells.iter().map(|cell| cell.n_vocab));
        // The bits of positive numbers sort as the numbers do.
        let budgets = sorted(cells.iter().map(|cell| cell.budget_flops.to_bits()));
        let budgets = budgets.into_iter().map(f64::from_bits).collect();
        Cells { cells, models, vocabs, budgets }
    }

    /// The best cell of each budget, by budget: the lower envelope.
    pub fn envelope(&self) -> Vec<&Cell> {
        let best = |&budget: &f64| best(self.cells.iter().filter(|c| c.budget_flops == budget));
        self.budgets.iter().filter_map(best).collect()
    }

    /// At one budget, the best vocabulary of each model, by size.
    pub fn best_of_models(&self, budget: f64) -> Vec<&Cell> {
        let of = |model: &Model| {
            best(self.cells.iter().filter(|c| c.budget_flops == budget && c.model == *model))
        };
        self.models.iter().filter_map(of).collect()
    }

    pub fn losses(&self) -> impl Iterator<Item = f64> {
        self.cells.iter().map(|cell| cell.loss_normalised)
    }

    /// How the points came about, for a figure's remarks.
    pub fn seeds_remark(&self) -> &'static str {
        let averaged = self.cells.iter().any(|cell| cell.seeds > 1);
        if averaged { "Points are means over seeds." } else { "One point a run." }
    }
}

/// What a run spent, by one rule.
pub type Flops = fn(&RunRecord) -> f64;

/// The count of a rule, as `laws.json` names it.
pub fn flops_of_rule(rule: &str) -> Option<Flops> {
    match rule {
        "openai" => Some(|run| run.flops_openai),
        "6nd" => Some(|run| run.flops_6nd),
        "exact" => Some(|run| run.flops_exact),
        _ => None,
    }
}

fn cell(runs: &[&RunRecord], flops: Flops) -> Cell {
    let mean = |of: Flops| runs.iter().map(|run| of(run)).sum::<f64>() / runs.len() as f64;
    Cell {
        model: Model::of(runs[0]),
        n_vocab: runs[0].n_vocab,
        budget_flops: runs[0].budget_flops,
        flops: mean(flops),
        loss_normalised: mean(|run| run.loss_normalised),
        seeds: runs.len(),
    }
}

fn best<'a>(cells: impl Iterator<Item = &'a Cell>) -> Option<&'a Cell> {
    cells.min_by(|a, b| a.loss_normalised.total_cmp(&b.loss_normalised))
}

fn sorted<T: Ord>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut values: Vec<_> = values.collect();
    values.sort_unstable();
    values.dedup();
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::simulated;

    #[test]
    fn seeds_of_a_cell_are_averaged() {
        let mut runs = vec![simulated::sweep().records[0].clone(); 3];
        for (run, loss) in runs.iter_mut().zip([-1.0, -2.0, -3.0]) {
            run.loss_normalised = loss;
        }
        let cells = Cells::of(&runs, |run| run.flops_exact);
        assert_eq!(cells.cells.len(), 1);
        assert_eq!((cells.cells[0].loss_normalised, cells.cells[0].seeds), (-2.0, 3));
    }

    #[test]
    fn the_envelope_is_never_above_a_run_of_its_budget() {
        let cells = Cells::of(&simulated::sweep().records, |run| run.flops_openai);
        let envelope = cells.envelope();
        assert_eq!(envelope.len(), cells.budgets.len());
        for cell in &cells.cells {
            let best = envelope.iter().find(|best| best.budget_flops == cell.budget_flops).unwrap();
            assert!(best.loss_normalised <= cell.loss_normalised);
        }
    }
}
