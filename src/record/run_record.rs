//! [`RunRecord`]: everything a finished run knows about itself, one row of `runs.parquet`.

use serde::{Deserialize, Serialize};

use crate::laws::IsoFlopPoint;
use crate::spec::FlopsRule;

/// One finished run: what was trained, what it spent, how well it did.
///
/// Written whole, by rename, after success only. Losses are in nats, times in seconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    /// Hash of the resolved spec, the data's digest, the tokenizer's id and the training revision.
    pub run_id: String,
    pub seed: u64,
    pub n_layer: usize,
    pub n_head: usize,
    pub d_model: usize,
    /// The true width of the feed-forward layer as built.
    pub d_ff: usize,
    /// Positions of the FLOP rule: text prefix and motion slots.
    pub n_ctx: usize,
    /// Codes, without special tokens (V).
    pub n_vocab: usize,
    /// The budget that the sweep declared (C).
    pub budget_flops: f64,
    /// Training FLOPs achieved, by ScaMo's Code 1.
    pub flops_openai: f64,
    /// 6 (N_nv + N_v) D.
    pub flops_6nd: f64,
    /// Multiply-adds of the model as built, prefix positions included, times two, times three.
    pub flops_exact: f64,
    /// Blocks and norms (N_nv).
    pub params_nonvocab: usize,
    /// V·d (N_v).
    pub params_vocab: usize,
    /// The projection of the text embeddings.
    pub params_text: usize,
    /// The embedding table as built, special tokens included.
    pub params_embedding: usize,
    /// The output head as built; zero where it is tied to the embedding.
    pub params_head: usize,
    /// Supervised motion tokens, end tokens included (D).
    pub tokens: usize,
    /// Distinct supervised tokens in the training split.
    pub unique_tokens: usize,
    /// `tokens / unique_tokens`.
    pub epochs: f64,
    pub steps: usize,
    /// Supervised tokens in a step.
    pub batch_tokens: usize,
    pub lr: f64,
    /// Cross-entropy on the test split, per supervised token.
    pub loss_nats: f64,
    /// L_u: cross-entropy minus that of the unigram model on the same targets.
    pub loss_normalised: f64,
    /// Cross-entropy per frame of motion; does not depend on V.
    pub nats_per_frame: f64,
    /// Cross-entropy per second of motion; does not depend on V.
    pub nats_per_second: f64,
    /// Test targets whose code the training split never showed.
    pub zero_count_targets: usize,
    pub wall_s: f64,
    pub tokens_per_s: f64,
    /// The most memory that the run had to itself: mapped files are shared, and left out.
    pub peak_bytes: u64,
    pub tokenizer_id: String,
    pub device: String,
    pub git_revision: String,
}

impl RunRecord {
    /// Training FLOPs achieved, by a rule.
    pub fn flops(&self, rule: FlopsRule) -> f64 {
        match rule {
            FlopsRule::OpenAi => self.flops_openai,
            FlopsRule::SixNd => self.flops_6nd,
            FlopsRule::Exact => self.flops_exact,
        }
    }

    /// The run as the laws see it, its FLOPs counted by a rule.
    pub fn point(&self, rule: FlopsRule) -> IsoFlopPoint {
        IsoFlopPoint {
            run_id: self.run_id.clone(),
            seed: self.seed,
            budget_flops: self.budget_flops,
            flops: self.flops(rule),
            params_nonvocab: self.params_nonvocab as f64,
            params_vocab: self.params_vocab as f64,
            n_vocab: self.n_vocab as f64,
            tokens: self.tokens as f64,
            loss_normalised: self.loss_normalised,
            weight: 1.0,
        }
    }
}

/// FLOPs of their budgets that runs spent a second, one at a time; `None` where that is no rate.
pub fn flops_per_second(records: impl IntoIterator<Item = RunRecord>) -> Option<f64> {
    let (mut flops, mut seconds) = (0.0, 0.0);
    for record in records {
        flops += record.budget_flops;
        seconds += record.wall_s;
    }
    Some(flops / seconds).filter(|rate| rate.is_finite() && *rate > 0.0)
}
