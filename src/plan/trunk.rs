//! Trunks: the common part of runs of one model, vocabulary and seed before their learning rates decay, trained
//! once.

use super::cells::GridCell;
use super::planned::PlannedRun;
use crate::spec::flops::TRAINING_PER_FORWARD;
use crate::spec::{FlopsPerToken, GeneratorSpec, Grid, ParamCounts, RunSpec, Share};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};

use crate::sweep::{BatchRule, LrRule, ModelEntry, RateParams, TrainSection};

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
/// The batch is the largest budget's, halved while it leaves the smallest fewer than `min_steps`: small runs tolerate
/// large batches better than large runs small ones. Rate and warm-up are the smallest budget's. A cell whose budget
/// cannot be met by whole steps of that batch is dropped. `price` gives the cost of a cell's token in steps of a
/// batch, and the D for its budget.
pub fn in_step(
    cells: Vec<PricedCell>,
    train: &TrainSection,
    price: impl Fn(&PricedCell, usize) -> (FlopsPerToken, f64),
) -> (Vec<PricedCell>, Vec<Dropped>) {
    let mut groups: HashMap<String, usize> = HashMap::new();
    let mut members: Vec<Vec<&PricedCell>> = Vec::new();
    let mut group_of = Vec::with_capacity(cells.len());
    for cell in &cells {
        // The key of a trunk.
        let GridCell { quantizer, share, .. } = &cell.grid_cell;
        let name = format!("{:?} {quantizer:?} {share:?}", cell.generator);
        let group = *groups.entry(name).or_insert(members.len());
        members.resize_with(members.len().max(group + 1), Vec::new);
        members[group].push(cell);
        group_of.push(group);
    }
    let common: Vec<(usize, Pace)> = members.iter().map(|cells| common(cells, train)).collect();
    let (mut kept, mut dropped) = (Vec::with_capacity(cells.len()), Vec::new());
    for (cell, group) in cells.into_iter().zip(group_of) {
        let (batch_tokens, pace) = common[group];
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
fn common(cells: &[&PricedCell], train: &TrainSection) -> (usize, Pace) {
    let bought = |cell: &PricedCell| cell.tokens_bought();
    let smallest = cells.iter().min_by(|a, b| bought(a).total_cmp(&bought(b)));
    let smallest = smallest.expect("a group has a cell");
    let (fewest, most) = (bought(smallest), cells.iter().map(|c| bought(c)).fold(0.0, f64::max));
    let batch_tokens = widest_batch(most, fewest, train);
    let steps = (fewest / batch_tokens as f64).round() as usize;
    let shortest = Spending { batch_tokens, steps, ..smallest.spending };
    (batch_tokens, pace(&smallest.params, smallest.spending.tokens(), shortest, train))
}

/// Sets the trunk of each run; returns the distinct trunks, each after the one that it continues. `chain_of` gives the
/// key that a run shares with others.
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
    let mut chain: Vec<Trunk> = Vec::new();
    for run in runs {
        let Some((spec, trunk_id)) = run.spec.trunk().zip(run.trunk_id.clone()) else { continue };
        let before = chain.last();
        let done = before.map_or(0, |before| before.spec.steps);
        let from = before.map(|before| before.trunk_id.clone());
        let flops_per_step = run.spec.budget_flops / run.spec.steps as f64;
        let flops = (spec.steps - done) as f64 * flops_per_step;
        chain.push(Trunk { trunk_id, spec, from, flops });
    }
    chain
}

// [`PricedCell`] and [`Dropped`]: a cell of the grid that can be trained, and one that cannot.

/// A cell that can be trained.
#[derive(Clone, Debug)]
pub struct PricedCell {
    pub grid_cell: GridCell,
    pub generator: GeneratorSpec,
    /// The codes that the quantizer's tokenizer gives clips.
    pub codes: Grid,
    pub params: ParamCounts,
    pub flops_per_token: FlopsPerToken,
    pub spending: Spending,
    pub pace: Pace,
    /// Cells of one number share a trunk; `None` if nothing is shared.
    pub group: Option<usize>,
}

impl PricedCell {
    /// D that the budget buys, before whole steps are made of it.
    pub fn tokens_bought(&self) -> f64 {
        self.spending.tokens() as f64 / self.spending.achieved_ratio
    }
}

/// A cell that is left out, with its reason.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dropped {
    pub n_layer: usize,
    pub n_head: usize,
    pub d_model: usize,
    pub n_vocab: usize,
    pub budget_flops: f64,
    pub share: Share,
    pub reason: String,
    /// By a condition of `grid.exclude`.
    #[serde(skip)]
    pub is_excluded: bool,
}

impl Dropped {
    /// A cell of the grid.
    pub fn new(cell: &GridCell, reason: String) -> Self {
        let GridCell { model, quantizer, budget_flops, share, .. } = cell;
        let ModelEntry { n_layer, n_head, d_model, .. } = *model;
        let (n_vocab, budget_flops, share) = (quantizer.n_vocab(), *budget_flops, *share);
        Self { n_layer, n_head, d_model, n_vocab, budget_flops, share, reason, is_excluded: false }
    }

    /// A cell that a condition of `grid.exclude` leaves out.
    pub fn excluded(cell: &GridCell, reason: String) -> Self {
        Self { is_excluded: true, ..Self::new(cell, reason) }
    }
}

// From a budget to tokens, steps, batch, learning rate and warm-up.

/// How one run spends its budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spending {
    /// Supervised tokens in a step.
    pub batch_tokens: usize,
    pub steps: usize,
    /// FLOPs spent over FLOPs declared.
    pub achieved_ratio: f64,
}

impl Spending {
    /// D, all supervised tokens of the run.
    pub fn tokens(self) -> usize {
        self.steps * self.batch_tokens
    }
}

/// Tokens beyond which counts of them are not exact any more.
pub const MOST_TOKENS: f64 = 9e15;

/// Largest relative error of a run's budget.
pub const BUDGET_TOLERANCE: f64 = 0.01;

/// D that a budget buys, before whole steps are made of it.
pub fn tokens_bought(budget: f64, flops_per_token: f64) -> f64 {
    budget / (TRAINING_PER_FORWARD * flops_per_token)
}

/// The batch of the rule for `tokens`; while it leaves `fewest` tokens fewer than `min_steps`, halved,
/// or less by a step of the rule.
pub fn widest_batch(tokens: f64, fewest: f64, train: &TrainSection) -> usize {
    let rule = &train.batch;
    let mut batch = batch_by_rule(tokens, rule);
    let less = |batch: usize| rule.multiple_of.map_or(batch / 2, |step| batch.saturating_sub(step));
    while fewest / (batch as f64) < train.min_steps as f64 && less(batch) >= rule.min {
        batch = less(batch);
    }
    batch
}

/// Whole steps of a batch that meet a number of tokens; the error is a sentence that says why none do.
pub fn spend_with(
    tokens: f64,
    batch_tokens: usize,
    train: &TrainSection,
) -> Result<Spending, String> {
    let (steps, least) = ((tokens / batch_tokens as f64).round() as usize, train.min_steps);
    if steps < least {
        return Err(format!(
            "the budget buys {tokens:.0} tokens, {steps} steps of {batch_tokens}: fewer than \
             train.min_steps = {least}"
        ));
    }
    let achieved_ratio = (steps * batch_tokens) as f64 / tokens;
    let missed = achieved_ratio - 1.0;
    if missed.abs() > BUDGET_TOLERANCE {
        let percent = 100.0 * missed;
        return Err(format!(
            "{steps} whole steps of {batch_tokens} tokens miss the budget by {percent:.1} %"
        ));
    }
    Ok(Spending { batch_tokens, steps, achieved_ratio })
}

/// The learning rate of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// The peak learning rate.
    pub lr: f64,
    pub warmup_steps: usize,
}

/// The rate by its rule for N and D; the warm-up of a run that spends so.
pub fn pace(params: &ParamCounts, tokens: usize, spending: Spending, train: &TrainSection) -> Pace {
    let trained = params.nonvocab + params.vocab;
    Pace {
        lr: learning_rate(params, tokens, &train.lr),
        warmup_steps: warmup_steps(spending, trained, train.schedule.warmup),
    }
}

/// The power of two, or the multiple of the rule's step, nearest to c·D^p within the rule's bounds.
fn batch_by_rule(tokens: f64, rule: &BatchRule) -> usize {
    let wanted = (rule.coefficient * tokens.powf(rule.tokens_exponent)).max(1.0);
    let rounded = match rule.multiple_of {
        Some(step) => (wanted / step as f64).round() as usize * step,
        None => 2f64.powi(wanted.log2().round() as i32) as usize,
    };
    rounded.clamp(rule.min, rule.max)
}

/// lr = c·N^p·D^q, at most the rule's maximum.
pub fn learning_rate(params: &ParamCounts, tokens: usize, rule: &LrRule) -> f64 {
    let vocab = if rule.params == RateParams::Total { params.vocab } else { 0 };
    let by_params = ((params.nonvocab + vocab) as f64).powf(rule.params_exponent);
    let by_tokens = (tokens as f64).powf(rule.tokens_exponent);
    (rule.coefficient * by_params * by_tokens).min(rule.max)
}

/// Warm-up steps: the declared share, and at most one token a parameter.
///
/// A warm-up that is long for a small model biases the exponents (Porian et al. 2024).
fn warmup_steps(spending: Spending, params: usize, share: f64) -> usize {
    let by_share = share * spending.steps as f64;
    let by_params = params as f64 / spending.batch_tokens as f64;
    by_share.min(by_params).floor() as usize
}

#[cfg(test)]
mod tests {
    use super::super::Plan;
    use super::*;
    use crate::data::DataFacts;
    use crate::sweep;
    use proptest::prelude::*;

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

    proptest! {
        #[test]
        fn spending_meets_the_tokens_or_says_why_not(
            log_tokens in 1.0..12.0f64, finely in any::<bool>(),
        ) {
            let tokens = 10f64.powf(log_tokens);
            let mut train = TrainSection::default();
            train.batch.multiple_of = finely.then_some(16);
            match spend_with(tokens, widest_batch(tokens, tokens, &train), &train) {
                Ok(found) => {
                    let ratio = found.tokens() as f64 / tokens;
                    prop_assert!((ratio - 1.0).abs() <= BUDGET_TOLERANCE);
                    prop_assert!((ratio - found.achieved_ratio).abs() < 1e-9);
                    prop_assert!(found.steps >= train.min_steps);
                    let batch = found.batch_tokens;
                    let rounded = train.batch.multiple_of.map_or(batch.is_power_of_two(), |step| {
                        batch.is_multiple_of(step)
                    });
                    prop_assert!(rounded, "{} tokens a step", batch);
                }
                Err(reason) => prop_assert!(tokens
                    < (train.min_steps * train.batch.min) as f64 * 1.01, "{reason}"),
            }
        }
    }

    #[test]
    fn a_batch_of_multiples_lies_nearest_to_its_rule_as_far_as_there_are_steps() {
        let batch = |tokens: f64, multiple_of: Option<usize>, min_steps: usize| {
            let rule = BatchRule { min: 32, multiple_of, ..BatchRule::default() };
            let train = TrainSection { batch: rule, min_steps, ..TrainSection::default() };
            widest_batch(tokens, tokens, &train)
        };
        // 0.35 · √250,000 = 175; 250,000 tokens are 2,000 steps of 125.
        assert_eq!([None, Some(16)].map(|of| batch(250_000.0, of, 1)), [128, 176]);
        assert_eq!([None, Some(16)].map(|of| batch(250_000.0, of, 2000)), [64, 112]);
    }

    #[test]
    fn warm_up_takes_at_most_one_token_a_parameter() {
        let spending = Spending { batch_tokens: 100, steps: 1000, achieved_ratio: 1.0 };
        assert_eq!(warmup_steps(spending, 1_000_000, 0.1), 100);
        assert_eq!(warmup_steps(spending, 2_500, 0.1), 25);
    }
}
