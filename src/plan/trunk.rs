//! Trunks: what runs of one model, vocabulary and seed have in common before their learning rates
//! decay, trained once.

use std::collections::{BTreeMap, HashMap};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::planned_run::PlannedRun;
use super::priced_cell::{Dropped, PricedCell};
use super::run_spec::RunSpec;
use super::steps::{Pace, Spending, pace, spend_with, widest_batch};
use crate::spec::FlopsPerToken;
use crate::sweep::TrainSection;

/// A stretch of training from one branching point to the next.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trunk {
    /// Content id of `spec`.
    pub trunk_id: String,
    pub spec: RunSpec,
    /// The trunk that it goes on from; `None` for the first.
    pub from: Option<String>,
    /// FLOPs from there on, in the measure of the runs' budgets.
    pub flops: f64,
}

/// Gives the cells that share a trunk one batch, one learning rate and one warm-up.
///
/// The batch is the largest budget's, halved while it leaves the smallest fewer than `min_steps`:
/// small runs bear large batches better than large runs small ones. Rate and warm-up are the
/// smallest budget's. A cell whose budget is missed by whole steps of that batch is dropped. `price`
/// says what a token of a cell costs in steps of a batch, and D that its budget then buys.
pub fn in_step(
    cells: Vec<PricedCell>,
    train: &TrainSection,
    price: impl Fn(&PricedCell, usize) -> (FlopsPerToken, f64),
) -> (Vec<PricedCell>, Vec<Dropped>) {
    let mut groups: HashMap<String, usize> = HashMap::new();
    let mut members: Vec<Vec<PricedCell>> = Vec::new();
    let mut order = Vec::with_capacity(cells.len());
    for cell in cells {
        let group = *groups.entry(group_name(&cell)).or_insert(members.len());
        if group == members.len() {
            members.push(Vec::new());
        }
        order.push((group, members[group].len()));
        members[group].push(cell);
    }
    let common: Vec<(usize, Pace)> = members.iter().map(|cells| common(cells, train)).collect();
    let (mut kept, mut dropped) = (Vec::with_capacity(order.len()), Vec::new());
    for (group, member) in order {
        let (cell, (batch_tokens, pace)) = (members[group][member].clone(), common[group]);
        let (flops_per_token, tokens) = price(&cell, batch_tokens);
        match spend_with(tokens, batch_tokens, train) {
            Ok(spending) => {
                let group = Some(group);
                kept.push(PricedCell { spending, pace, group, flops_per_token, ..cell });
            }
            Err(reason) => dropped.push(Dropped::new(&cell.grid_cell, reason)),
        }
    }
    (kept, dropped)
}

/// The batch in tokens and the pace of cells that differ in budget alone, of which there is one.
fn common(cells: &[PricedCell], train: &TrainSection) -> (usize, Pace) {
    let by_tokens =
        |a: &&PricedCell, b: &&PricedCell| a.tokens_bought().total_cmp(&b.tokens_bought());
    let smallest = cells.iter().min_by(by_tokens).expect("a group has a cell");
    let most = cells.iter().map(PricedCell::tokens_bought).fold(0.0, f64::max);
    let batch_tokens = widest_batch(most, smallest.tokens_bought(), train);
    let steps = (smallest.tokens_bought() / batch_tokens as f64).round() as usize;
    let shortest = Spending { batch_tokens, steps, ..smallest.spending };
    (batch_tokens, pace(&smallest.params, smallest.spending.tokens(), shortest, train))
}

/// What cells must agree in to share a trunk.
fn group_name(cell: &PricedCell) -> String {
    format!("{:?} {:?} {:?}", cell.generator, cell.grid_cell.quantizer, cell.grid_cell.share)
}

/// Notes in each run which trunk it branches off; returns the trunks, each once, every one after
/// the one that it goes on from. `chain_of` names what the run of an index shares with others.
pub fn branch(
    runs: &mut [PlannedRun],
    chain_of: impl Fn(usize) -> Option<(usize, usize)>,
) -> Vec<Trunk> {
    let stem = |run: &RunSpec| run.trunk().filter(|trunk| trunk.steps > 0);
    runs.par_iter_mut().for_each(|run| run.trunk_id = stem(&run.spec).map(|trunk| trunk.id()));
    let mut chains: BTreeMap<(usize, usize), BTreeMap<usize, usize>> = BTreeMap::new();
    for (index, run) in runs.iter().enumerate() {
        if let (Some(_), Some(chain)) = (&run.trunk_id, chain_of(index)) {
            let steps = run.spec.steps - run.spec.decay_steps.unwrap_or(0);
            chains.entry(chain).or_default().insert(steps, index);
        }
    }
    chains.values().flat_map(|points| chained(points.values().map(|&i| &runs[i]))).collect()
}

/// The trunks of one chain, of runs by their steps.
fn chained<'a>(runs: impl Iterator<Item = &'a PlannedRun>) -> Vec<Trunk> {
    let (mut chain, mut done, mut from): (Vec<Trunk>, usize, Option<String>) = Default::default();
    for run in runs {
        let (Some(spec), Some(trunk_id)) = (run.spec.trunk(), run.trunk_id.clone()) else {
            continue;
        };
        let flops_per_step = run.spec.budget_flops / run.spec.steps as f64;
        let flops = (spec.steps - done) as f64 * flops_per_step;
        done = spec.steps;
        let before = from.replace(trunk_id.clone());
        chain.push(Trunk { trunk_id, spec, from: before, flops });
    }
    chain
}

#[cfg(test)]
mod tests {
    use crate::data::DataFacts;
    use crate::plan::Plan;
    use crate::sweep;

    fn planned(budgets: &str, train: &str) -> Plan {
        let text = format!(
            "name: t\ngrid: {{models: [{{n_layer: 1, n_head: 1, d_model: 16}}, \
             {{n_layer: 2, n_head: 2, d_model: 32}}], vocab: [64], budgets: {budgets}}}\n\
             seeds: [0, 1]\ntrain: {{schedule: {{kind: wsd, share: true}}{train}}}\n"
        );
        let sweep = sweep::parse("t.yaml", &text, &[]).expect("a sweep");
        Plan::new(&sweep, DataFacts::absent(String::new()))
    }

    #[test]
    fn each_trunk_goes_on_from_the_last_and_they_cost_what_the_longest_run_does() {
        let plan = planned("[1e10, 1.8e10, 3.2e10, 5.6e10, 1e11]", "");
        assert_eq!((plan.runs.len(), plan.trunks.len()), (20, 20));
        for chain in plan.trunks.chunks(5) {
            assert_eq!(chain[0].from, None);
            for pair in chain.windows(2) {
                assert_eq!(pair[1].from.as_ref(), Some(&pair[0].trunk_id));
                assert!(pair[1].spec.steps > pair[0].spec.steps);
            }
            let shared: f64 = chain.iter().map(|trunk| trunk.flops).sum();
            assert!((shared / 8e10 - 1.0).abs() < 0.01, "{shared}");
        }
        // 0.8 · (1 − 1e11 / 2.16e11) of all FLOPs are trained once for all.
        let saved = 1.0 - plan.trained_flops() / plan.total_flops();
        assert!((saved - 0.43).abs() < 0.002, "{saved}");
    }

    #[test]
    fn all_have_the_batch_of_the_largest_as_far_as_the_smallest_has_steps() {
        let batches = |budgets: &str| -> Vec<usize> {
            let runs = planned(budgets, ", min_steps: 300").runs;
            runs.iter().map(|run| run.spec.batch_tokens).collect()
        };
        // Two seeds of each model and budget, model after model.
        let (alone, shared) = (batches("[1e11]"), batches("[2e10, 1e11]"));
        for (shared, alone) in shared.chunks(4).zip(alone.chunks(2)) {
            assert!(shared.iter().all(|batch| *batch == shared[0]));
            assert!(shared[0] <= alone[0]);
        }
        assert_eq!(shared[0], alone[0], "the small model has steps enough");
        for run in planned("[1e9, 1e11]", ", min_steps: 300").runs {
            assert!(run.spec.steps >= 300);
        }
    }

    #[test]
    fn a_larger_budget_changes_no_run_of_the_same_batch() {
        let ids = |plan: Plan| plan.runs.into_iter().map(|run| run.run_id).collect::<Vec<_>>();
        let pinned = ", batch: {min: 64, max: 64}";
        let few = ids(planned("[1e10, 3e10]", pinned));
        let more = ids(planned("[1e10, 3e10, 1e12]", pinned));
        assert!(few.iter().all(|id| more.contains(id)));
    }
}
