//! [`Plan`]: every job of a sweep with its id and its cost.

use super::cells::{Renamed, renamed};
use super::planned::{EvaluatorJob, PlannedRun, ScoreJob, remarks};
use super::price::price;
use super::trunk::{Dropped, PricedCell, Trunk, branch};
use crate::data::{DataFacts, Demand};
use crate::spec::{
    EvaluatorSection, Origin, RunSpec, ShownCaptions, TRAINING_REVISION, TextSpec, TokenizerJob,
    TrainerProgram, content_id,
};
use crate::sweep::{ScheduleKind, ScheduleSection, Sweep, Variant};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashSet};
use std::ops::Range;

/// Epochs above which repeated data is worth less than new (Muennighoff et al. 2023).
pub const MOST_USEFUL_EPOCHS: f64 = 4.0;

/// Every job of a sweep.
#[derive(Clone, Debug)]
pub struct Plan {
    pub runs: Vec<PlannedRun>,
    pub dropped: Vec<Dropped>,
    pub tokenizers: Vec<TokenizerJob>,
    /// The shared beginnings of runs, in the order of training.
    pub trunks: Vec<Trunk>,
    /// `None` if the sweep has no motion, so no captions.
    pub text: Option<TextJob>,
    /// `None` if the sweep names none.
    pub evaluator: Option<EvaluatorJob>,
    /// The scores of scored runs.
    pub scores: Vec<ScoreJob>,
    pub data: DataFacts,
    /// Vocabularies that have another number of codes than the sweep names.
    pub renamed: Vec<Renamed>,
    /// Combinations of the keys that the sweep varies; 1 if it varies none.
    pub n_variants: usize,
    /// Whether the cheapest run goes before all others, to try a user's program.
    pub canary: bool,
    /// Warnings about its training.
    remarks: Vec<String>,
}

impl Plan {
    /// Expands a sweep over its data, variant by variant.
    pub fn new(sweep: &Sweep, data: DataFacts) -> Self {
        let plan =
            |variant: &Variant| Self::of_variant(&variant.sweep, &variant.label, data.clone());
        let plans: Vec<Self> = sweep.variants().iter().map(plan).collect();
        plans.into_iter().reduce(Self::and).expect("a sweep is one variant at least")
    }

    fn of_variant(sweep: &Sweep, label: &Option<String>, data: DataFacts) -> Self {
        let (cells, dropped) = price(sweep, &data.shapes);
        let captions = TextJob::new(&sweep.text, &data.digest, data.embeddings.clone());
        let text_id = captions.id();
        let text = (sweep.data.origin() != Origin::None).then_some(captions);
        let (tokenizers, own) = tokenizers(sweep, &cells, &data, &text_id);
        let of = |tokenizer_id, unique_tokens, captions| {
            let text_id = text_id.clone();
            RunInputs { tokenizer_id, text_id, unique_tokens, captions }
        };
        let known = tokenizers.iter().map(|job| {
            of(job.id(), data.unique_tokens(&job.spec.grid()), ShownCaptions::of(&job.spec))
        });
        let mut inputs: Vec<RunInputs> = known.collect();
        if inputs.is_empty() {
            inputs.push(of(NO_TOKENIZER.to_string(), 0, ShownCaptions::Drawn));
        }
        let runs_of = |(cell, own): (&PricedCell, &Range<usize>)| {
            let run = |inputs, seed| planned_run(sweep, label, cell, seed, inputs, &data);
            let with = |inputs| sweep.seeds.iter().map(move |seed| run(inputs, *seed));
            inputs[own.clone()].iter().flat_map(with).collect::<Vec<_>>()
        };
        // Hashing a million specs is most of the work.
        let mut runs: Vec<PlannedRun> = cells.par_iter().zip(&own).flat_map_iter(runs_of).collect();
        let per_cell = runs.len() / cells.len().max(1);
        let chain_of = |run: usize| Some((cells[run / per_cell].group?, run % per_cell));
        let trunks =
            if sweep.train.schedule.shares() { branch(&mut runs, chain_of) } else { Vec::new() };
        let remarks = remarks(sweep, &tokenizers, &runs, &data);
        let spec =
            |section: &EvaluatorSection| data.evaluator.clone().unwrap_or_else(|| section.spec());
        let evaluator = sweep.evaluator.as_ref();
        let evaluator = evaluator.map(|section| EvaluatorJob::new(spec(section), &data));
        let judged = evaluator.as_ref().zip(sweep.scores.as_ref());
        let scores = judged.map(|(judge, spec)| ScoreJob::of_runs(&runs, &judge.id(), spec));
        Self {
            canary: sweep.trainer.as_ref().is_some_and(|trainer| trainer.canary),
            runs,
            dropped,
            tokenizers,
            trunks,
            text,
            evaluator,
            scores: scores.unwrap_or_default(),
            data,
            renamed: renamed(sweep),
            n_variants: 1,
            remarks,
        }
    }

    /// The plan with the jobs of another variant of its sweep.
    fn and(mut self, other: Self) -> Self {
        add_new(&mut self.tokenizers, other.tokenizers, TokenizerJob::id);
        add_new(&mut self.trunks, other.trunks, |trunk| trunk.trunk_id.clone());
        add_new(&mut self.remarks, other.remarks, String::clone);
        self.runs.extend(other.runs);
        self.dropped.extend(other.dropped);
        self.scores.extend(other.scores);
        self.n_variants += other.n_variants;
        self
    }

    /// The plan with other runs on the same tokenizers, each trained alone and not scored.
    pub fn with_runs(&self, runs: Vec<PlannedRun>) -> Self {
        Self { runs, trunks: Vec::new(), evaluator: None, scores: Vec::new(), ..self.clone() }
            .only(|_| true)
    }

    /// The plan of some of its runs, with their dependencies.
    pub fn only(&self, is_kept: impl Fn(&PlannedRun) -> bool) -> Self {
        let runs = chosen(&self.runs, is_kept);
        let tokenizers: HashSet<&str> =
            runs.iter().map(|run| run.spec.tokenizer_id.as_str()).collect();
        let mut trunks: HashSet<&str> =
            runs.iter().filter_map(|run| run.trunk_id.as_deref()).collect();
        // Each trunk comes after the one that it continues.
        for trunk in self.trunks.iter().rev() {
            if trunks.contains(trunk.trunk_id.as_str()) {
                trunks.extend(trunk.from.as_deref());
            }
        }
        let kept: HashSet<&str> = runs.iter().map(|run| run.run_id.as_str()).collect();
        Self {
            dropped: self.dropped.clone(),
            tokenizers: chosen(&self.tokenizers, |job| tokenizers.contains(job.id().as_str())),
            trunks: chosen(&self.trunks, |trunk| trunks.contains(trunk.trunk_id.as_str())),
            text: self.text.clone(),
            evaluator: self.evaluator.clone(),
            scores: chosen(&self.scores, |job| kept.contains(job.run_id.as_str())),
            data: self.data.clone(),
            renamed: self.renamed.clone(),
            n_variants: self.n_variants,
            canary: self.canary,
            remarks: self.remarks.clone(),
            runs,
        }
    }

    /// FLOPs of all runs together, as declared.
    pub fn total_flops(&self) -> f64 {
        // The sum of nothing is −0.
        0.0 + self.runs.iter().map(|run| run.spec.budget_flops).sum::<f64>()
    }

    /// FLOPs to train: shared parts count once.
    pub fn trained_flops(&self) -> f64 {
        let own = self.runs.iter().map(PlannedRun::own_flops).sum::<f64>();
        0.0 + own + self.trunks.iter().map(|trunk| trunk.flops).sum::<f64>()
    }

    /// Bytes of the results: weights of each run, weights and moments of each trunk, codes of each tokenizer, and
    /// temporary checkpoints of three times a run's weights. Files of a user's trainer are unknown and not counted.
    pub fn disk_bytes(&self) -> u64 {
        let kept = self.runs.iter().filter(|run| !run.spec.is_users_own());
        let weights: usize = kept.map(|run| 4 * run.params.total()).sum();
        let codes = self.tokenizers.len() * 4 * self.unique_tokens();
        let params = |trunk: &Trunk| trunk.spec.params().total();
        let trunks: usize = self.trunks.iter().map(|trunk| 12 * params(trunk)).sum();
        (weights + trunks + codes) as u64
    }

    /// The tokenizer that a run waits for; `None` if the sweep has no motion.
    pub fn tokenizer_of(&self, run: &PlannedRun) -> Option<&TokenizerJob> {
        self.tokenizers.iter().find(|job| job.id() == run.spec.tokenizer_id)
    }

    /// Supervised tokens of the training split, for the codes of the first run; 0 without a run.
    pub fn unique_tokens(&self) -> usize {
        self.runs.first().map_or(0, |run| self.data.unique_tokens(&run.spec.codes))
    }

    /// Warnings before this runs.
    pub fn warnings(&self) -> Vec<String> {
        let epochs = self.runs.iter().filter_map(|run| run.epochs);
        let repeated: Vec<f64> = epochs.filter(|epochs| *epochs > MOST_USEFUL_EPOCHS).collect();
        let mut warnings = self.data.warnings.clone();
        if let Some(most) = repeated.iter().copied().reduce(f64::max) {
            let (n, of, tokens) = (repeated.len(), self.runs.len(), self.unique_tokens());
            warnings.push(format!(
                "{n} of {of} runs see their data more than {MOST_USEFUL_EPOCHS} times, up to {most:.0}: \
                 the training split holds {tokens} tokens"
            ));
        }
        warnings.extend(self.remarks.iter().cloned());
        warnings
    }
}

fn chosen<T: Clone>(all: &[T], is_kept: impl Fn(&T) -> bool) -> Vec<T> {
    all.iter().filter(|one| is_kept(one)).cloned().collect()
}

/// Adds items with new keys.
fn add_new<T>(known: &mut Vec<T>, others: Vec<T>, key: impl Fn(&T) -> String) {
    let keys: HashSet<String> = known.iter().map(&key).collect();
    known.extend(others.into_iter().filter(|other| !keys.contains(&key(other))));
}

/// The clips that the longest run of a sweep needs from an unlimited source, priced before its clips are known.
pub fn demand(sweep: &Sweep) -> Option<Demand> {
    let priced = |variant: Variant| price(&variant.sweep, &BTreeMap::new()).0;
    let cells = sweep.variants().into_iter().flat_map(priced);
    let longest = cells.max_by_key(|cell| cell.spending.tokens())?;
    Some(Demand { targets: longest.spending.tokens(), codes: longest.codes })
}

// Priced cells into tokenizers and runs.

/// Replaces the id of a tokenizer in a run if the sweep has no motion.
pub const NO_TOKENIZER: &str = "none";

/// The distinct tokenizers of all cells, and the indices of each cell's own, one per seed; none if the sweep has no
/// data for them.
fn tokenizers(
    sweep: &Sweep,
    cells: &[PricedCell],
    data: &DataFacts,
    text_id: &str,
) -> (Vec<TokenizerJob>, Vec<Range<usize>>) {
    if sweep.data.origin() == Origin::None {
        return (Vec::new(), vec![0..1; cells.len()]);
    }
    let mut jobs: Vec<TokenizerJob> = Vec::new();
    let mut own = Vec::with_capacity(cells.len());
    for cell in cells {
        let known = jobs.iter().position(|job| job.spec.quantizer == cell.grid_cell.quantizer);
        let specs = sweep.tokenizer.specs(&cell.grid_cell.quantizer, &sweep.text);
        let first = known.unwrap_or(jobs.len());
        own.push(first..first + specs.len());
        if known.is_none() {
            jobs.extend(specs.into_iter().map(|spec| TokenizerJob {
                revision: TRAINING_REVISION,
                data_digest: data.digest.clone(),
                text_id: spec.architecture.language().map(|_| text_id.to_string()),
                spec,
            }));
        }
    }
    (jobs, own)
}

/// The inputs of a tokenizer's runs.
struct RunInputs {
    tokenizer_id: String,
    text_id: String,
    /// Supervised tokens of the training split.
    unique_tokens: usize,
    /// What clips show where the sweep does not say.
    captions: ShownCaptions,
}

fn decay_steps(schedule: &ScheduleSection, steps: usize) -> Option<usize> {
    let decay = schedule.decay * steps as f64;
    (schedule.kind == ScheduleKind::Wsd).then(|| (decay.round() as usize).clamp(1, steps))
}

fn planned_run(
    sweep: &Sweep,
    varied: &Option<String>,
    cell: &PricedCell,
    seed: u64,
    inputs: &RunInputs,
    data: &DataFacts,
) -> PlannedRun {
    let train = &sweep.train;
    let steps = cell.spending.steps;
    let spec = RunSpec {
        revision: TRAINING_REVISION,
        seed,
        generator: cell.generator.clone(),
        codes: cell.codes.clone(),
        budget_flops: cell.grid_cell.budget_flops,
        share: cell.grid_cell.share,
        captions: train.captions.unwrap_or(inputs.captions),
        batch_tokens: cell.spending.batch_tokens,
        steps,
        lr: cell.pace.lr,
        warmup_steps: cell.pace.warmup_steps,
        final_share: train.schedule.final_share,
        decay_steps: decay_steps(&train.schedule, steps),
        precision: train.precision,
        weight_decay: train.weight_decay,
        betas: [train.betas[0], train.betas[1]],
        epsilon: train.epsilon,
        clip_norm: (train.clip_norm > 0.0).then_some(train.clip_norm),
        evaluations: train.evaluations,
        fps: data.fps,
        data_digest: data.digest.clone(),
        text_id: inputs.text_id.clone(),
        tokenizer_id: inputs.tokenizer_id.clone(),
        trainer: sweep.trainer.as_ref().map(|section| TrainerProgram {
            command: section.command.clone(),
            revision: section.revision.clone(),
            inputs: data.trainer_inputs.clone(),
        }),
        varied: varied.clone(),
    };
    let (tokens, unique_tokens) = (spec.tokens() as f64, spec.share.of(inputs.unique_tokens));
    PlannedRun {
        run_id: spec.id(),
        params: cell.params,
        flops_per_token: cell.flops_per_token,
        achieved_ratio: cell.spending.achieved_ratio,
        peak_bytes: cell.generator.peak_bytes(&cell.codes, spec.batch_tokens),
        trunk_id: None,
        epochs: (unique_tokens > 0).then(|| tokens / unique_tokens as f64),
        spec,
    }
}

// [`TextJob`]: the captions of a data set, to be embedded once.

/// The request to the text encoder, and its captions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TextJob {
    /// Without the path: a file that is moved is the same.
    pub spec: TextSpec,
    pub data_digest: String,
    /// Digest of the file of vectors, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub embeddings: Option<String>,
}

impl TextJob {
    /// The job of a sweep's `text` section on data, and on a file's content, of these digests.
    pub fn new(spec: &TextSpec, data_digest: &str, embeddings: Option<String>) -> Self {
        let spec = TextSpec { path: None, ..spec.clone() };
        Self { spec, data_digest: data_digest.to_string(), embeddings }
    }

    /// Content id: the hash of every field.
    pub fn id(&self) -> String {
        content_id(self)
    }
}
