//! The runs of the next round, out of the grid's.

use std::collections::HashSet;

use isoflop::jobs::JobState;
use isoflop::laws::{DesignGoal, OpenRun, next_runs};
use isoflop::plan::{Plan, PlannedRun};
use isoflop::record::RunRecord;

use super::history::History;
use crate::commands::context::OpenSweep;
use crate::commands::fit::points;

/// The share of the grid's FLOPs that a round spends at least, where windows grow.
const SHARE: f64 = 0.03;

/// The runs of the next round, by id, after `records` of those before; none where the grid is trained.
pub fn next(
    whole: &OpenSweep,
    records: &[RunRecord],
    history: &History,
    budget_flops: f64,
) -> Vec<String> {
    let (points, _) = points(records, whole.sweep.flops.rule);
    let (taken, states): (HashSet<&str>, _) = (history.runs().collect(), whole.folder.run_states());
    let is_open = |run: &&PlannedRun| {
        !taken.contains(run.run_id.as_str()) && states.of(&run.run_id) != JobState::Failed
    };
    let open: Vec<&PlannedRun> = whole.plan.runs.iter().filter(is_open).collect();
    let offered: Vec<OpenRun> = open.iter().map(|run| open_run(&whole.plan, run)).collect();
    let spend_flops = SHARE * whole.plan.total_flops();
    let chosen = next_runs(&points, &offered, DesignGoal { budget_flops, spend_flops });
    chosen.into_iter().map(|i| open[i].run_id.clone()).collect()
}

fn open_run(plan: &Plan, run: &PlannedRun) -> OpenRun {
    let unique_tokens = plan.data.unique_tokens(&run.spec.codes);
    OpenRun {
        budget_flops: run.spec.budget_flops,
        flops: run.spec.budget_flops,
        params_nonvocab: run.params.nonvocab as f64,
        n_vocab: run.spec.n_vocab() as f64,
        tokens: run.spec.tokens() as f64,
        unique_tokens: (unique_tokens > 0).then_some(unique_tokens as f64),
    }
}
