//! [`Plan`]: every job of a sweep with its id and its price.

use std::collections::{BTreeMap, HashSet};
use std::ops::Range;

use rayon::prelude::*;

use super::evaluator_job::EvaluatorJob;
use super::expand::{RunInputs, planned_run, tokenizers};
use super::planned_run::PlannedRun;
use super::price::price;
use super::priced_cell::{Dropped, PricedCell};
use super::remarks::remarks;
use super::run_spec::TokenizerJob;
use super::score_job::ScoreJob;
use super::text_job::TextJob;
use super::trunk::{Trunk, branch};
use super::vocabulary::{Renamed, renamed};
use crate::data::{DataFacts, Demand};
use crate::sweep::{Origin, Sweep, Variant};

/// Epochs above which repeated data is worth less than new (Muennighoff et al. 2023).
pub const MOST_USEFUL_EPOCHS: f64 = 4.0;

/// Every job of a sweep.
#[derive(Clone, Debug)]
pub struct Plan {
    pub runs: Vec<PlannedRun>,
    pub dropped: Vec<Dropped>,
    pub tokenizers: Vec<TokenizerJob>,
    /// Where runs share their beginnings: what they have in common, in the order of training.
    pub trunks: Vec<Trunk>,
    /// `None` where the sweep has no motion, so no captions.
    pub text: Option<TextJob>,
    /// `None` where the sweep names none.
    pub evaluator: Option<EvaluatorJob>,
    /// Of the runs that are scored.
    pub scores: Vec<ScoreJob>,
    pub data: DataFacts,
    /// Vocabularies that have another number of codes than the sweep names.
    pub renamed: Vec<Renamed>,
    /// Combinations of the keys that the sweep varies; 1 where it varies none.
    pub n_variants: usize,
    /// Whether the cheapest run goes before all others, to try a program of somebody's own.
    pub canary: bool,
    /// What a person should know of its training.
    remarks: Vec<String>,
}

impl Plan {
    /// Expands a sweep over its data: what it varies, one after another.
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
        let inputs = match tokenizers.is_empty() {
            false => tokenizers.iter().map(|job| RunInputs::of(job, &text_id, &data)).collect(),
            true => vec![RunInputs::none(text_id)],
        };
        let runs_of = |(cell, own): (&PricedCell, &Range<usize>)| {
            let run = |inputs, seed| planned_run(sweep, cell, seed, (inputs, label), &data);
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
        let evaluator = sweep.evaluator.as_ref();
        let evaluator = evaluator.map(|section| EvaluatorJob::new(section.spec(), &data));
        let scores = match (&evaluator, &sweep.scores) {
            (Some(evaluator), Some(spec)) => ScoreJob::of_runs(&runs, &evaluator.id(), spec),
            _ => Vec::new(),
        };
        let canary = sweep.trainer.as_ref().is_some_and(|trainer| trainer.canary);
        Self {
            runs,
            dropped,
            tokenizers,
            trunks,
            text,
            evaluator,
            scores,
            data,
            renamed: renamed(sweep),
            n_variants: 1,
            canary,
            remarks,
        }
    }

    /// The plan with the jobs of another variant of its sweep.
    fn and(mut self, other: Self) -> Self {
        let known: HashSet<String> = self.tokenizers.iter().map(TokenizerJob::id).collect();
        self.tokenizers
            .extend(other.tokenizers.into_iter().filter(|job| !known.contains(&job.id())));
        let known: HashSet<String> =
            self.trunks.iter().map(|trunk| trunk.trunk_id.clone()).collect();
        self.trunks
            .extend(other.trunks.into_iter().filter(|trunk| !known.contains(&trunk.trunk_id)));
        let remarks = other.remarks.into_iter().filter(|remark| !self.remarks.contains(remark));
        let remarks: Vec<String> = remarks.collect();
        self.remarks.extend(remarks);
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

    /// The plan of some of its runs, with what those need.
    pub fn only(&self, is_kept: impl Fn(&PlannedRun) -> bool) -> Self {
        let runs: Vec<PlannedRun> = self.runs.iter().filter(|run| is_kept(run)).cloned().collect();
        let tokenizers: HashSet<&str> =
            runs.iter().map(|run| run.spec.tokenizer_id.as_str()).collect();
        let mut trunks: HashSet<&str> =
            runs.iter().filter_map(|run| run.trunk_id.as_deref()).collect();
        // Each trunk stands after the one that it goes on from.
        for trunk in self.trunks.iter().rev() {
            if trunks.contains(trunk.trunk_id.as_str()) {
                trunks.extend(trunk.from.as_deref());
            }
        }
        let kept: HashSet<&str> = runs.iter().map(|run| run.run_id.as_str()).collect();
        let is_scored = |job: &&ScoreJob| kept.contains(job.run_id.as_str());
        let is_used = |job: &&TokenizerJob| tokenizers.contains(job.id().as_str());
        let is_stem = |trunk: &&Trunk| trunks.contains(trunk.trunk_id.as_str());
        Self {
            dropped: self.dropped.clone(),
            tokenizers: self.tokenizers.iter().filter(is_used).cloned().collect(),
            trunks: self.trunks.iter().filter(is_stem).cloned().collect(),
            text: self.text.clone(),
            evaluator: self.evaluator.clone(),
            scores: self.scores.iter().filter(is_scored).cloned().collect(),
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

    /// FLOPs that are trained: what runs share counts once.
    pub fn trained_flops(&self) -> f64 {
        let own = self.runs.iter().map(PlannedRun::own_flops).sum::<f64>();
        0.0 + own + self.trunks.iter().map(|trunk| trunk.flops).sum::<f64>()
    }

    /// Bytes of the results: weights of each run, weights and moments of each trunk, codes of each
    /// tokenizer; checkpoints while they last are three times a run's weights. What a user's program keeps is not
    /// known, and not counted.
    pub fn disk_bytes(&self) -> u64 {
        let kept = self.runs.iter().filter(|run| !run.spec.is_users_own());
        let weights: usize = kept.map(|run| 4 * run.params.total()).sum();
        let codes = self.tokenizers.len() * 4 * self.unique_tokens();
        let params = |trunk: &Trunk| trunk.spec.params().total();
        let trunks: usize = self.trunks.iter().map(|trunk| 12 * params(trunk)).sum();
        (weights + trunks + codes) as u64
    }

    /// The tokenizer that a run waits for; `None` where the sweep has no motion.
    pub fn tokenizer_of(&self, run: &PlannedRun) -> Option<&TokenizerJob> {
        self.tokenizers.iter().find(|job| job.id() == run.spec.tokenizer_id)
    }

    /// Supervised tokens of the training split, for the codes of the first run; 0 without a run.
    pub fn unique_tokens(&self) -> usize {
        self.runs.first().map_or(0, |run| self.data.unique_tokens(&run.spec.codes))
    }

    /// What a person should know before this runs.
    pub fn warnings(&self) -> Vec<String> {
        let epochs = self.runs.iter().filter_map(|run| run.epochs);
        let repeated: Vec<f64> = epochs.filter(|epochs| *epochs > MOST_USEFUL_EPOCHS).collect();
        let mut warnings = self.data.warnings.clone();
        if let Some(most) = repeated.iter().copied().reduce(f64::max) {
            warnings.push(format!(
                "{} of {} runs see their data more than {MOST_USEFUL_EPOCHS} times, up to {most:.0}: \
                 the training split holds {} tokens",
                repeated.len(),
                self.runs.len(),
                self.unique_tokens()
            ));
        }
        warnings.extend(self.remarks.iter().cloned());
        warnings
    }
}

/// What the longest run of a sweep takes of a source without an end, priced before its clips are known.
pub fn demand(sweep: &Sweep) -> Option<Demand> {
    let priced = |variant: Variant| price(&variant.sweep, &BTreeMap::new()).0;
    let cells = sweep.variants().into_iter().flat_map(priced);
    let longest = cells.max_by_key(|cell| cell.spending.tokens())?;
    Some(Demand { targets: longest.spending.tokens(), codes: longest.codes })
}
