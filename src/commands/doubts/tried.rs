//! [`Tried`]: what a plan tries at a budget.

use std::collections::{BTreeMap, BTreeSet};

use isoflop::plan::{Plan, PlannedRun};

/// A size of model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    pub params_nonvocab: f64,
    pub n_layer: usize,
    pub d_model: usize,
}

/// The sizes and vocabularies of a generator at a budget, ascending.
#[derive(Clone, Debug, PartialEq)]
pub struct Tried {
    pub budget_flops: f64,
    pub sizes: Vec<Size>,
    pub vocab: Vec<usize>,
    /// Whether the laws that are known say something of such runs: of codes of one codebook that this program
    /// makes of motion, one after another.
    pub has_law: bool,
}

/// Those of each generator, by budget.
pub fn tried(plan: &Plan) -> Vec<Vec<Tried>> {
    let mut runs: BTreeMap<&str, BTreeMap<u64, Vec<&PlannedRun>>> = BTreeMap::new();
    for run in &plan.runs {
        let of_generator = runs.entry(run.spec.generator.name()).or_default();
        // Budgets are above 0, so their bits are in their order.
        of_generator.entry(run.spec.budget_flops.to_bits()).or_default().push(run);
    }
    let of_budgets = |budgets: BTreeMap<u64, Vec<&PlannedRun>>| {
        let at = |(bits, runs): (u64, Vec<&PlannedRun>)| at(f64::from_bits(bits), &runs, plan);
        budgets.into_iter().map(at).collect()
    };
    runs.into_values().map(of_budgets).collect()
}

fn at(budget_flops: f64, runs: &[&PlannedRun], plan: &Plan) -> Tried {
    let sizes: BTreeMap<usize, Size> = runs.iter().map(|run| size(run)).collect();
    let vocab: BTreeSet<usize> = runs.iter().map(|run| run.spec.n_vocab()).collect();
    let is_known = |run: &&PlannedRun| {
        run.spec.generator.name() == "autoregressive" && run.spec.codes.scales.len() == 1
    };
    Tried {
        budget_flops,
        sizes: sizes.into_values().collect(),
        vocab: vocab.into_iter().collect(),
        has_law: !plan.tokenizers.is_empty() && runs.iter().all(is_known),
    }
}

fn size(run: &PlannedRun) -> (usize, Size) {
    let (n, shape) = (run.params.nonvocab, run.spec.shape());
    (n, Size { params_nonvocab: n as f64, n_layer: shape.n_layer, d_model: shape.d_model })
}
