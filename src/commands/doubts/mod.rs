//! [`doubts`]: what will be in doubt of a sweep's minima, told before the hours are spent.

mod doubt;
pub use doubt::Doubt;

use doubt::tried;
use isoflop::plan::Plan;
use isoflop::sweep::Sweep;

/// What is in doubt of a plan, one of each kind for each generator at most. A sweep of one size makes no law, so
/// nothing of its grid is in doubt.
pub fn doubts(sweep: &Sweep, plan: &Plan) -> Vec<Doubt> {
    let generators = tried(plan);
    let is_study = generators.iter().flatten().any(|budget| budget.sizes.len() > 1);
    let mut found: Vec<Doubt> = Vec::new();
    if is_study {
        for budgets in &generators {
            let own = [doubt::doubts(budgets), doubt::doubts_bracket(budgets)].concat();
            // Generators that share their sizes share what is in doubt of them.
            found
                .extend(own.into_iter().filter(|doubt| !found.contains(doubt)).collect::<Vec<_>>());
        }
        found.extend(one_budget(plan));
        found.extend(one_seed(sweep, plan));
    }
    found.extend(small_test(plan));
    found
}

#[cfg(test)]
mod tests;

// Losses that are measured too roughly: on too few codes, or once.

/// Codes of the test split below which its mean loss is too rough to tell sizes apart.
const FEWEST_CODES: f64 = 2000.0;
/// Standard error of the mean loss times the square root of the number of codes, in nats: 3.3 to 4.4 on 512 clips of
/// procedural motion, whose codes go together within a clip.
const ERROR_OF_A_CODE: f64 = 3.5;

/// Standard deviation of the mean loss of what was recorded together, in nats: 3.3 over nine performers of CMU's
/// motion, 2.4 over 27 sessions of Bandai's.
const ERROR_OF_A_GROUP: f64 = 3.0;
/// Groups below which that is worth a word.
const FEWEST_GROUPS: usize = 36;

/// A grid of one budget has no law in C.
fn one_budget(plan: &Plan) -> Option<Doubt> {
    let first = plan.runs.first()?.spec.budget_flops;
    plan.runs.iter().all(|run| run.spec.budget_flops == first).then(|| {
        let what = "all runs have one budget, which gives a minimum and no law in C";
        of_study("one-budget", [what, "list three budgets or more"].map(String::from))
    })
}

/// Nothing tells the noise of runs from the curve of the loss.
fn one_seed(sweep: &Sweep, plan: &Plan) -> Option<Doubt> {
    if sweep.seeds.len() > 1 || sweep.tokenizer.seeds.len() > 1 {
        return None;
    }
    let what = "each cell is trained once, so the noise of runs is guessed from how they scatter round a \
                surface";
    let mend = format!("set seeds: [0, 1], which doubles the {} runs", plan.runs.len());
    Some(of_study("one-seed", [what.to_string(), mend]))
}

/// The test split has too few codes, or too few groups.
fn small_test(plan: &Plan) -> Option<Doubt> {
    let words = too_few(test_codes(plan)?, plan.data.clips[2], plan.data.test_groups)?;
    Some(of_study("small-test", words))
}

fn of_study(kind: &'static str, [what, mend]: [String; 2]) -> Doubt {
    Doubt { kind, what, mend, budgets_flops: Vec::new() }
}

/// What is wrong with a test split of so many codes in clips of so many groups that were recorded together, and
/// what to change; `None` if it measures a loss.
pub fn too_few(codes: f64, clips: usize, groups: usize) -> Option<[String; 2]> {
    let error = |codes: f64| ERROR_OF_A_CODE / codes.sqrt();
    if groups < clips.min(FEWEST_GROUPS) {
        let of_groups = ERROR_OF_A_GROUP / (groups.max(1) as f64).sqrt();
        return Some([
            format!(
                "the test split holds {groups} groups of clips that were recorded together: all losses move \
                 by about ±{of_groups:.1} nats on others"
            ),
            "give test clips of more performers or sessions".to_string(),
        ]);
    }
    (codes < FEWEST_CODES).then(|| {
        [
            format!(
                "the test split holds about {codes:.0} codes: the mean loss is known to ±{:.2} nats",
                error(codes)
            ),
            format!(
                "{FEWEST_CODES} codes bring that to {:.2}: give more test clips",
                error(FEWEST_CODES)
            ),
        ]
    })
}

/// Supervised codes of the test split, if its clips are as long as those of the training split; `None` without
/// data.
fn test_codes(plan: &Plan) -> Option<f64> {
    let [train, _, test] = plan.data.clips;
    let per_clip = plan.unique_tokens() as f64 / train as f64;
    (train > 0 && per_clip > 0.0).then_some(per_clip * test as f64)
}
