//! [`JobKind`], [`JobId`] and [`Job`]: a job, by its kind and product, with its dependencies.

use std::collections::HashMap;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::plan::{
    EvaluatorJob, Plan, PlannedRun, ScoreJob, TextJob, Trunk, evaluator_peak_bytes,
    text_peak_bytes, tokenizer_peak_bytes, tokens_peak_bytes,
};
use crate::spec::{ModelShape, TokenizerJob};
use crate::sweep::Stage;

/// A kind of job, in order of dependency: each depends only on earlier kinds, or on its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JobKind {
    /// Embeds every caption of the data once.
    Text,
    /// Trains a tokenizer and measures it.
    Tokenizer,
    /// Turns every clip of the data into codes.
    Tokens,
    /// Trains a trunk, from the one that it goes on from, up to where runs branch off.
    Trunk,
    /// Trains a run, the goal of a sweep. Later kinds run next to it or after it.
    Run,
    /// Trains an evaluator and measures its gates.
    Evaluator,
    /// Makes motions of a run and scores them.
    Score,
}

impl JobKind {
    /// Every kind, in its order.
    pub const ALL: [Self; 7] = [
        Self::Text,
        Self::Tokenizer,
        Self::Tokens,
        Self::Trunk,
        Self::Run,
        Self::Evaluator,
        Self::Score,
    ];

    /// Its word, the plural, its role for a run, and the file that it writes last.
    fn facts(self) -> [&'static str; 4] {
        match self {
            Self::Text => ["text", "text", "the embedding of captions", "vectors.safetensors"],
            Self::Tokenizer => ["tokenizer", "tokenizers", "its tokenizer", "metrics.json"],
            Self::Tokens => ["tokens", "tokens", "tokenising", "codes.safetensors"],
            Self::Trunk => ["trunk", "trunks", "its trunk", "state.safetensors"],
            Self::Run => ["run", "runs", "the run", "record.json"],
            Self::Evaluator => ["evaluator", "evaluators", "its evaluator", "gates.json"],
            Self::Score => ["score", "scores", "its score", "scores.json"],
        }
    }

    /// The word in files and on a worker's command line.
    pub fn word(self) -> &'static str {
        self.facts()[0]
    }

    /// The name of many of them, for tables and folders.
    pub fn plural(self) -> &'static str {
        self.facts()[1]
    }

    /// Its role in the message of a run that waits for it: `its tokenizer`.
    pub fn role(self) -> &'static str {
        self.facts()[2]
    }

    /// The file in a job's folder that is written when all else is there.
    pub fn product(self) -> &'static str {
        self.facts()[3]
    }

    /// The folder of the job of an id, in a sweep's folder.
    pub fn folder(self, id: &str) -> PathBuf {
        match self {
            Self::Tokens => Self::Tokenizer.folder(id).join(self.plural()),
            _ => PathBuf::from(self.plural()).join(id),
        }
    }

    /// The specification file of a job by id, in a sweep's folder.
    pub fn spec(self, id: &str) -> PathBuf {
        match self {
            Self::Text => PathBuf::from("sweep.yaml"),
            Self::Tokens => Self::Tokenizer.spec(id),
            Self::Run => self.folder(id).join("spec.json"),
            _ => self.folder(id).join("job.json"),
        }
    }

    /// The part of a sweep that it belongs to.
    pub fn stage(self) -> Stage {
        match self {
            Self::Trunk | Self::Run | Self::Score => Stage::Train,
            _ => Stage::Inputs,
        }
    }

    /// Whether its product is a result, so that it is remade if lost even if no job depends on it.
    pub fn is_result(self) -> bool {
        matches!(self, Self::Tokenizer | Self::Evaluator | Self::Score)
    }
}

impl FromStr for JobKind {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        let kind = Self::ALL.into_iter().find(|kind| kind.word() == word);
        kind.ok_or_else(|| format!("no kind of job is named `{word}`"))
    }
}

/// One thing to do. Its id is the hash of all that its result depends on; jobs of different kinds
/// may have the same, as a tokenizer and its codes do.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct JobId {
    pub kind: JobKind,
    pub id: String,
}

impl JobId {
    /// The job of a kind with this id.
    pub fn new(kind: JobKind, id: impl Into<String>) -> Self {
        Self { kind, id: id.into() }
    }

    /// The run of an id.
    pub fn run(id: impl Into<String>) -> Self {
        Self::new(JobKind::Run, id)
    }
}

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} {}", self.kind.word(), self.id)
    }
}

/// One thing to do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    pub id: JobId,
    /// For a person.
    pub label: String,
    /// FLOPs, to order jobs and to weigh progress; a rough figure for all that does not train a
    /// generator.
    pub cost: f64,
    /// Memory expected at its peak, in bytes; 0 if that is not known.
    pub peak_bytes: u64,
    /// Its dependencies.
    pub needs: Vec<JobId>,
}

/// The cost of tokenising, as a fraction of training the tokenizer.
const TOKENISING: f64 = 0.1;

/// FLOPs that a motion counts for, as a multiple of the model's parameters: a forward pass a code.
const FLOPS_PER_PARAMETER: f64 = 2.0 * 49.0;

impl JobKind {
    /// The jobs of a plan, finished ones too; one that needs another of its kind after that one.
    pub fn jobs(self, plan: &Plan) -> Vec<Job> {
        match self {
            Self::Text => plan.text.iter().map(|job| text(job, plan)).collect(),
            Self::Tokenizer => plan.tokenizers.iter().map(|job| tokenizer(job, plan)).collect(),
            Self::Tokens => plan.tokenizers.iter().map(|job| tokens(job, plan)).collect(),
            Self::Trunk => plan.trunks.iter().map(trunk).collect(),
            Self::Run => {
                let text = plan.text.iter().map(|text| JobId::new(Self::Text, text.id()));
                let (captions, canary) = (text.collect::<Vec<_>>(), canary(plan));
                plan.runs.par_iter().map(|one| run(one, &captions, canary, plan)).collect()
            }
            Self::Evaluator => plan.evaluator.iter().map(|job| evaluator(job, plan)).collect(),
            Self::Score => scores(plan),
        }
    }
}

fn text(text: &TextJob, plan: &Plan) -> Job {
    Job {
        id: JobId::new(JobKind::Text, text.id()),
        label: "captions".to_string(),
        cost: 0.0,
        peak_bytes: text_peak_bytes(&text.spec, &plan.data),
        needs: Vec::new(),
    }
}

fn tokenizer(job: &TokenizerJob, plan: &Plan) -> Job {
    Job {
        id: JobId::new(JobKind::Tokenizer, job.id()),
        label: format!("{} tokenizer V{}", job.spec.quantizer.name(), job.spec.n_vocab()),
        cost: tokenizer_cost(job),
        peak_bytes: tokenizer_peak_bytes(&job.spec, &plan.data),
        needs: captions(job).into_iter().collect(),
    }
}

/// FLOPs of training a tokenizer, on the scale of the budgets of runs.
fn tokenizer_cost(job: &TokenizerJob) -> f64 {
    let training = &job.spec.training;
    let frames = (training.steps * training.batch * training.window) as f64;
    frames * job.spec.flops_per_frame()
}

/// The job that a tokenizer with language waits for: the captions that it sees.
pub fn captions(job: &TokenizerJob) -> Option<JobId> {
    job.text_id.as_ref().map(|id| JobId::new(JobKind::Text, id))
}

fn tokens(job: &TokenizerJob, plan: &Plan) -> Job {
    let tokenizer = JobId::new(JobKind::Tokenizer, job.id());
    Job {
        id: JobId::new(JobKind::Tokens, job.id()),
        label: format!("codes V{}", job.spec.n_vocab()),
        cost: TOKENISING * tokenizer_cost(job),
        peak_bytes: tokens_peak_bytes(&job.spec, &plan.data),
        needs: captions(job).into_iter().chain([tokenizer]).collect(),
    }
}

fn trunk(trunk: &Trunk) -> Job {
    let Trunk { trunk_id, spec, from, flops } = trunk;
    let data = [(JobKind::Tokens, &spec.tokenizer_id), (JobKind::Text, &spec.text_id)];
    let needs = data.into_iter().chain(from.iter().map(|id| (JobKind::Trunk, id)));
    let ModelShape { n_layer, d_model, .. } = *spec.shape();
    let (n_vocab, seed, steps) = (spec.n_vocab(), spec.seed, spec.steps);
    Job {
        id: JobId::new(JobKind::Trunk, trunk_id),
        label: format!("L{n_layer} d{d_model} V{n_vocab} seed {seed} to step {steps}"),
        cost: *flops,
        peak_bytes: spec.generator.peak_bytes(&spec.codes, spec.batch_tokens),
        needs: needs.map(|(kind, id)| JobId::new(kind, id)).collect(),
    }
}

/// The run that tries a user's program before the others: the cheapest.
fn canary(plan: &Plan) -> Option<&PlannedRun> {
    let cheapest = plan.runs.iter().min_by(|a, b| a.own_flops().total_cmp(&b.own_flops()));
    cheapest.filter(|_| plan.canary)
}

fn run(run: &PlannedRun, captions: &[JobId], canary: Option<&PlannedRun>, plan: &Plan) -> Job {
    let first = canary.filter(|canary| canary.run_id != run.run_id);
    let first = first.map(|canary| JobId::run(&canary.run_id));
    let codes =
        (!plan.tokenizers.is_empty()).then(|| JobId::new(JobKind::Tokens, &run.spec.tokenizer_id));
    let trunk = run.trunk_id.iter().map(|id| JobId::new(JobKind::Trunk, id));
    Job {
        id: JobId::run(&run.run_id),
        label: run.spec.label(),
        cost: run.own_flops(),
        // The memory of a user's trainer is unknown.
        peak_bytes: run.known_peak_bytes().unwrap_or(0),
        needs: captions.iter().cloned().chain(first).chain(codes).chain(trunk).collect(),
    }
}

fn evaluator(job: &EvaluatorJob, plan: &Plan) -> Job {
    Job {
        id: JobId::new(JobKind::Evaluator, job.id()),
        label: "evaluator".to_string(),
        cost: job.spec.training_flops(),
        peak_bytes: evaluator_peak_bytes(&job.spec, &plan.data),
        needs: Vec::new(),
    }
}

fn scores(plan: &Plan) -> Vec<Job> {
    if plan.scores.is_empty() {
        return Vec::new();
    }
    let runs: HashMap<&str, &PlannedRun> =
        plan.runs.iter().map(|run| (run.run_id.as_str(), run)).collect();
    let of = |job: &ScoreJob| Some(score(job, runs.get(job.run_id.as_str())?, plan));
    plan.scores.iter().filter_map(of).collect()
}

fn score(score: &ScoreJob, run: &PlannedRun, plan: &Plan) -> Job {
    let [.., test] = plan.data.clips;
    let ScoreJob { run_id, evaluator_id, spec, .. } = score;
    let motions = spec.repeats * test + spec.multimodal_captions * spec.multimodal_motions;
    let evaluator = plan.evaluator.as_ref();
    let evaluating = evaluator.map_or(0, |job| evaluator_peak_bytes(&job.spec, &plan.data));
    Job {
        id: JobId::new(JobKind::Score, score.id()),
        label: format!("score of {}", run.spec.label()),
        cost: motions as f64 * run.params.total() as f64 * FLOPS_PER_PARAMETER,
        // Generating a batch of motions needs less than a training step, and true motions are in memory as for the
        // evaluator's gates.
        peak_bytes: run.peak_bytes + evaluating,
        needs: vec![JobId::run(run_id), JobId::new(JobKind::Evaluator, evaluator_id)],
    }
}
