//! [`PlannedRun`], a run with its id and cost; the jobs of scores: [`EvaluatorJob`] and [`ScoreJob`]; and remarks on a plan.

use crate::data::DataFacts;
use crate::spec::{
    EVALUATOR_REVISION, EvaluatorSpec, FlopsPerToken, ModelShape, ParamCounts, QuantizerSpec,
    RunSpec, ScoresSpec, TRAINING_REVISION, TokenizerJob, content_id,
};
use crate::sweep::{Condition, Sweep};
use serde::{Deserialize, Serialize};

/// One run of the plan.
#[derive(Clone, Debug)]
pub struct PlannedRun {
    pub run_id: String,
    pub spec: RunSpec,
    pub params: ParamCounts,
    pub flops_per_token: FlopsPerToken,
    pub achieved_ratio: f64,
    /// The cost for the built-in trainer.
    pub peak_bytes: u64,
    /// The trunk that it branches off; `None` if it is trained alone.
    pub trunk_id: Option<String>,
    /// Times that the run sees each token of the training split; `None` if it is not here.
    pub epochs: Option<f64>,
}

impl PlannedRun {
    /// Peak bytes of the run; `None` for a user's trainer, whose memory is unknown.
    pub fn known_peak_bytes(&self) -> Option<u64> {
        self.spec.trainer.is_none().then_some(self.peak_bytes)
    }

    /// FLOPs of the budget that the run's own job trains: all except its trunk's.
    pub fn own_flops(&self) -> f64 {
        let RunSpec { budget_flops, steps, decay_steps, .. } = self.spec;
        match (&self.trunk_id, decay_steps) {
            (Some(_), Some(decay)) => budget_flops * decay as f64 / steps as f64,
            _ => budget_flops,
        }
    }
}

// [`ScoreJob`]: a run whose motions are to be scored.

/// One run to score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreJob {
    pub revision: u32,
    pub run_id: String,
    pub evaluator_id: String,
    /// Without its conditions, which choose runs and change none.
    pub spec: ScoresSpec,
}

impl ScoreJob {
    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }

    /// The scores of those runs that a `scores` section chooses.
    pub fn of_runs(runs: &[PlannedRun], evaluator_id: &str, spec: &ScoresSpec) -> Vec<Self> {
        let conditions: Vec<Condition> =
            spec.only.iter().filter_map(|text| Condition::parse(text).ok()).collect();
        let chosen = |run: &&PlannedRun| {
            conditions.is_empty() || conditions.iter().any(|condition| holds(condition, run))
        };
        let score = |run: &PlannedRun| Self {
            revision: TRAINING_REVISION,
            run_id: run.run_id.clone(),
            evaluator_id: evaluator_id.to_string(),
            spec: spec.of_a_run(),
        };
        runs.iter().filter(chosen).map(score).collect()
    }
}

fn holds(condition: &Condition, PlannedRun { spec, .. }: &PlannedRun) -> bool {
    let ModelShape { n_layer, n_head, d_model, .. } = *spec.shape();
    let [n_layer, n_head, d_model, v] =
        [n_layer, n_head, d_model, spec.n_vocab()].map(|n| n as f64);
    condition.holds([n_layer, n_head, d_model, v, spec.budget_flops, spec.share.value()])
}

// [`EvaluatorJob`]: an evaluator to train, which all scores of a sweep are taken by.

/// One evaluator to train. It depends only on the data, so sweeps that differ in anything else share it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluatorJob {
    pub revision: u32,
    pub spec: EvaluatorSpec,
    pub data_digest: String,
}

impl EvaluatorJob {
    /// The job of a sweep's `evaluator` section on its data.
    pub fn new(spec: EvaluatorSpec, data: &DataFacts) -> Self {
        Self { revision: EVALUATOR_REVISION, spec, data_digest: data.digest.clone() }
    }

    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }
}

// Warnings about the training of a plan, before it runs.

/// Training steps below which the codes of a tokenizer are mostly the initial ones.
const FEWEST_TOKENIZER_STEPS: usize = 100;

/// Warns of tokenizers and runs with too few steps, and of rates and batches at their bounds.
pub(super) fn remarks(
    sweep: &Sweep,
    tokenizers: &[TokenizerJob],
    runs: &[PlannedRun],
    data: &DataFacts,
) -> Vec<String> {
    let steps = tokenizers.iter().map(|job| job.spec.training.steps).min();
    let few = steps.filter(|steps| *steps < FEWEST_TOKENIZER_STEPS).map(|steps| {
        format!(
            "the tokenizers are trained for {steps} steps: their codes will be little better than the \
            initial ones; `isoflop tokenizer eval` compares them with k-means"
        )
    });
    few.into_iter().chain(context(sweep, runs, data)).chain(of_runs(sweep, runs)).collect()
}

/// Warns of clips that do not fit the models' context after a text of `text.max_tokens`.
fn context(sweep: &Sweep, runs: &[PlannedRun], data: &DataFacts) -> Option<String> {
    let frames = data.longest_clip();
    let room = |run: &PlannedRun| run.spec.shape().n_ctx - sweep.text.max_tokens;
    let positions = |run: &PlannedRun| {
        let codes = &run.spec.codes;
        run.spec.generator.positions(codes, frames) + usize::from(codes.end_token)
    };
    let has_clips = sweep.trainer.is_none() && frames > 0;
    let run = runs.iter().find(|run| has_clips && positions(run) > room(run))?;
    let tokenizer = sweep.tokenizer.spec(QuantizerSpec::default(), &sweep.text);
    let (taken, room, slots) = (positions(run), room(run), frames / tokenizer.stride() + 2);
    Some(format!(
        "a clip of {frames} frames takes {taken} positions, but the models have room for {room}: runs fail \
        on it unless its text is short; set model.motion_slots to {slots} or more"
    ))
}

fn of_runs(sweep: &Sweep, runs: &[PlannedRun]) -> Vec<String> {
    if sweep.trainer.is_some() {
        return Vec::new();
    }
    let train = &sweep.train;
    let count = |is: &dyn Fn(&PlannedRun) -> bool| runs.iter().filter(|run| is(run)).count();
    let beta2 = train.betas[1];
    let memory = 1.0 / (1.0 - beta2);
    let chosen = train.batch.tokens_exponent == 0.0;
    let cases = [
        (
            count(&|run| run.spec.lr >= train.lr.max && !train.lr.is_constant()),
            format!(
                "are trained at train.lr.max = {}, because the rule asks for more",
                train.lr.max
            ),
        ),
        (
            count(&|run| run.spec.batch_tokens >= train.batch.max && !chosen),
            format!("have the batch of train.batch.max = {}", train.batch.max),
        ),
        (
            count(&|run| (run.spec.steps as f64) < memory),
            format!("have fewer than {memory:.0} steps, the memory of beta2 = {beta2}"),
        ),
    ];
    let met = cases.into_iter().filter(|(n, _)| *n > 0);
    met.map(|(n, what)| format!("{n} of {} runs {what}", runs.len())).collect()
}

#[cfg(test)]
mod tests {
    use crate::data::{self, DataFacts};
    use crate::plan::Plan;
    use crate::sweep;

    fn warnings(more: &str) -> Vec<String> {
        let text = format!(
            "name: t\ndata: {{source: procedural, clips: 8}}\n\
             grid: {{models: [{{n_layer: 1, n_head: 1, d_model: 16}}], vocab: [64], budgets: [1e11]}}\n{more}"
        );
        let sweep = sweep::parse("t.yaml", &text, &[]).expect("a sweep");
        Plan::new(&sweep, DataFacts::absent(String::new())).warnings()
    }

    fn says(more: &str, words: &str) -> bool {
        warnings(more).iter().any(|warning| warning.contains(words))
    }

    #[test]
    fn rates_and_batches_at_their_bounds_are_named() {
        let free = "train: {lr: {max: 1}, batch: {max: 65536}}";
        assert!(!says(free, "1 of 1 runs"), "{:?}", warnings(free));
        assert!(says(
            "train: {lr: {max: 1e-3}}",
            "1 of 1 runs are trained at train.lr.max = 0.001"
        ));
        assert!(says("train: {batch: {max: 64}}", "have the batch of train.batch.max = 64"));
    }

    #[test]
    fn clips_that_do_not_fit_the_context_are_named() {
        let text = "name: t\ndata: {source: procedural, clips: 8}\n\
                    grid: {models: [{n_layer: 1, n_head: 1, d_model: 16}], vocab: [64], budgets: [1e11]}\n\
                    tokenizer: {kind: patch, quantizer: {kind: residual}}\n";
        let told = |more: &str| {
            let sweep = sweep::parse("t.yaml", &format!("{text}{more}"), &[]).expect("a sweep");
            let source = data::open(&sweep.data, None).expect("a source");
            let warnings = Plan::new(&sweep, DataFacts::of(&*source)).warnings();
            warnings.iter().any(|warning| warning.contains("set model.motion_slots to"))
        };
        assert!(!told("") && told("model: {motion_slots: 20}"));
    }

    #[test]
    fn too_few_steps_are_named() {
        let slow = "train: {lr: {max: 1}, betas: [0.9, 0.9999], min_steps: 1}";
        assert!(says(slow, "have fewer than 10000 steps"), "{:?}", warnings(slow));
        assert!(says("tokenizer: {steps: 10}", "the tokenizers are trained for 10 steps"));
        assert!(!says("tokenizer: {steps: 600}", "the tokenizers are trained"));
    }
}
