//! [`Job`]: one thing to do, and what it waits for; [`missing_jobs`]: all that a plan still wants.

use std::collections::HashMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::data::DataFacts;
use crate::plan::{
    ModelShape, Plan, PlannedRun, RunSpec, TokenizerJob, Trunk, peak_bytes, text_peak_bytes,
    tokenizer_peak_bytes, tokens_peak_bytes,
};
use crate::record::{JobId, JobKind, JobState, ResultsFolder};

/// One thing to do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    pub id: JobId,
    /// For a person.
    pub label: String,
    /// FLOPs, to order jobs and to weigh progress; a rough figure for all but runs and trunks.
    pub cost: f64,
    /// Memory expected at its peak, in bytes; 0 where that is not known.
    pub peak_bytes: u64,
    /// What must be there first.
    pub needs: Vec<JobId>,
}

/// Everything that a plan's runs need, each after what it needs itself.
pub fn inputs(plan: &Plan) -> Vec<Job> {
    let text = plan.text.iter().map(|text| Job {
        id: JobId::new(JobKind::Text, text.id()),
        label: "captions".to_string(),
        cost: 0.0,
        peak_bytes: text_peak_bytes(&text.spec, &plan.data),
        needs: Vec::new(),
    });
    let tokenizers = plan.tokenizers.iter();
    let tokenizers =
        tokenizers.flat_map(|job| [tokenizer(job, &plan.data), tokens(job, &plan.data)]);
    text.chain(tokenizers).chain(plan.trunks.iter().map(trunk)).collect()
}

/// Every job of a plan, finished ones too, each after what it needs itself.
pub fn all_jobs(plan: &Plan) -> impl Iterator<Item = Job> {
    inputs(plan).into_iter().chain(plan.runs.iter().map(|one| run(one, plan)))
}

/// The job of a run.
fn run(run: &PlannedRun, plan: &Plan) -> Job {
    let mut needs = data_needs(&run.spec.tokenizer_id, plan);
    needs.extend(run.trunk_id.iter().map(|id| JobId::new(JobKind::Trunk, id)));
    Job {
        id: JobId::run(&run.run_id),
        label: run.spec.label(),
        cost: run.own_flops(),
        // What a program of somebody's own takes is not known.
        peak_bytes: if run.spec.trainer.is_some() { 0 } else { run.peak_bytes },
        needs,
    }
}

fn trunk(trunk: &Trunk) -> Job {
    let Trunk { trunk_id, spec, from, flops } = trunk;
    let params = spec.model.params(spec.n_vocab);
    let data = [(JobKind::Tokens, &spec.tokenizer_id), (JobKind::Text, &spec.text_id)];
    let needs = data.into_iter().chain(from.iter().map(|id| (JobKind::Trunk, id)));
    Job {
        id: JobId::new(JobKind::Trunk, trunk_id),
        label: trunk_label(spec),
        cost: *flops,
        peak_bytes: peak_bytes(&spec.model, spec.n_vocab, params, spec.batch_tokens),
        needs: needs.map(|(kind, id)| JobId::new(kind, id)).collect(),
    }
}

fn trunk_label(RunSpec { model, n_vocab, steps, seed, .. }: &RunSpec) -> String {
    let ModelShape { n_layer, d_model, .. } = model;
    format!("L{n_layer} d{d_model} V{n_vocab} seed {seed} to step {steps}")
}

fn data_needs(tokenizer_id: &str, plan: &Plan) -> Vec<JobId> {
    let text = plan.text.iter().map(|text| JobId::new(JobKind::Text, text.id()));
    let tokens = (!plan.tokenizers.is_empty()).then(|| JobId::new(JobKind::Tokens, tokenizer_id));
    text.chain(tokens).collect()
}

/// FLOPs of a training frame as a multiple of width², so counted that they take as long as those of
/// a run: a step of 2048 frames at width 64 takes as long as 1.3e9 FLOPs of a small model.
const FLOPS_PER_FRAME_AND_WIDTH_SQUARED: f64 = 150.0;

/// FLOPs that training a tokenizer counts for, beside the budgets of runs.
pub fn tokenizer_cost(job: &TokenizerJob) -> f64 {
    let spec = &job.spec;
    let frames = (spec.steps * spec.batch * spec.window) as f64;
    frames * FLOPS_PER_FRAME_AND_WIDTH_SQUARED * (spec.width as f64).powi(2)
}

fn tokenizer(job: &TokenizerJob, data: &DataFacts) -> Job {
    let kind = &job.spec.kind;
    Job {
        id: JobId::new(JobKind::Tokenizer, job.id()),
        label: format!("{} tokenizer V{}", kind.name(), kind.n_vocab()),
        cost: tokenizer_cost(job),
        peak_bytes: tokenizer_peak_bytes(&job.spec, data),
        needs: Vec::new(),
    }
}

fn tokens(job: &TokenizerJob, data: &DataFacts) -> Job {
    Job {
        id: JobId::new(JobKind::Tokens, job.id()),
        label: format!("codes V{}", job.spec.kind.n_vocab()),
        cost: 0.1 * tokenizer_cost(job),
        peak_bytes: tokens_peak_bytes(&job.spec, data),
        needs: vec![JobId::new(JobKind::Tokenizer, job.id())],
    }
}

/// The jobs whose results are not in the folder and that can be had, the most urgent first: what
/// the longest chain of work waits for.
///
/// What failed is not among them, nor what needs it; what is there already is no job's need.
pub fn missing_jobs(plan: &Plan, folder: &ResultsFolder) -> Vec<Job> {
    let open = |id: &JobId| matches!(folder.state(id), JobState::Missing | JobState::Started);
    let runs: Vec<Job> =
        plan.runs.par_iter().map(|one| run(one, plan)).filter(|job| open(&job.id)).collect();
    let mut wanted = Wanted::new(inputs(plan), folder);
    let runs: Vec<Job> = runs.into_iter().filter_map(|job| wanted.take(job)).collect();
    for id in plan.tokenizers.iter().map(TokenizerJob::id) {
        let [tokenizer, tokens] =
            [JobKind::Tokenizer, JobKind::Tokens].map(|kind| JobId::new(kind, &id));
        // Its codes are there, but its metrics are not any more.
        if folder.state(&tokens) == JobState::Done && open(&tokenizer) {
            wanted.standing(&tokenizer);
        }
    }
    by_urgency(wanted.jobs.into_iter().chain(runs).collect())
}

/// Picks what is needed out of all inputs, as the runs that need it come.
struct Wanted<'a> {
    folder: &'a ResultsFolder,
    inputs: HashMap<JobId, Job>,
    /// Whether each input that was asked for can be had, and whether it is still to be made.
    known: HashMap<JobId, Standing>,
    jobs: Vec<Job>,
}

#[derive(Clone, Copy, PartialEq)]
enum Standing {
    There,
    ToDo,
    Lost,
}

impl<'a> Wanted<'a> {
    fn new(inputs: Vec<Job>, folder: &'a ResultsFolder) -> Self {
        let inputs = inputs.into_iter().map(|job| (job.id.clone(), job)).collect();
        Self { folder, inputs, known: HashMap::new(), jobs: Vec::new() }
    }

    /// The job with only those needs left that are still to be made; `None` where one is lost.
    fn take(&mut self, mut job: Job) -> Option<Job> {
        let standings: Vec<Standing> = job.needs.iter().map(|need| self.standing(need)).collect();
        let mut standing = standings.iter();
        job.needs.retain(|_| standing.next() == Some(&Standing::ToDo));
        (!standings.contains(&Standing::Lost)).then_some(job)
    }

    fn standing(&mut self, id: &JobId) -> Standing {
        if let Some(known) = self.known.get(id) {
            return *known;
        }
        let standing = match (self.folder.state(id), self.inputs.get(id).cloned()) {
            (JobState::Done, _) => Standing::There,
            (JobState::Failed, _) | (_, None) => Standing::Lost,
            (_, Some(job)) => match self.take(job) {
                Some(job) => {
                    self.jobs.push(job);
                    Standing::ToDo
                }
                None => Standing::Lost,
            },
        };
        self.known.insert(id.clone(), standing);
        standing
    }
}

/// Sorts jobs by the work of the longest chain that begins with each, longest first.
fn by_urgency(jobs: Vec<Job>) -> Vec<Job> {
    let mut waiting: HashMap<&JobId, f64> = HashMap::new();
    let mut urgency = vec![0.0; jobs.len()];
    // What needs a job comes after it, so backwards every one is known when it is asked for.
    for (job, urgency) in jobs.iter().zip(&mut urgency).rev() {
        *urgency = job.cost + waiting.get(&job.id).copied().unwrap_or(0.0);
        for need in &job.needs {
            let chain = waiting.entry(need).or_insert(0.0);
            *chain = chain.max(*urgency);
        }
    }
    let mut order: Vec<usize> = (0..jobs.len()).collect();
    order.sort_by(|&a, &b| urgency[b].total_cmp(&urgency[a]));
    let mut jobs: Vec<Option<Job>> = jobs.into_iter().map(Some).collect();
    order.into_iter().filter_map(|i| jobs[i].take()).collect()
}

#[cfg(test)]
mod tests;
