//! What every kind of generator reads and gives.

use serde::{Deserialize, Serialize};

use crate::codes::TokenStore;
use crate::learn::weights::Sources;
use crate::text::TextStore;

/// What a run reads, mapped and shared with the runs beside it.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    pub tokens: &'a TokenStore,
    pub text: &'a TextStore,
}

/// A finished run.
pub struct Trained {
    pub weights: Sources,
    /// On the test split.
    pub test: SplitLoss,
    pub log: Vec<LogLine>,
    /// Training FLOPs by the exact count.
    pub flops_exact: f64,
    /// Seconds, those of earlier processes included.
    pub wall_s: f64,
}

/// Losses of a model on a split, in nats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitLoss {
    /// Mean −ln p over targets, end tokens included where clips have them.
    pub loss_nats: f64,
    /// L_u: mean of −ln p + ln p_uni over the same targets (ScaMo §4.4); p_uni is that of the target's
    /// own scale.
    ///
    /// From log-probabilities throughout: a ratio of probabilities would underflow first.
    pub loss_normalised: f64,
    /// Cross-entropy per frame of motion.
    pub nats_per_frame: f64,
    pub targets: usize,
}

/// A line of `log.jsonl`: a run measured on the validation split.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogLine {
    pub step: usize,
    /// Supervised tokens so far.
    pub tokens: usize,
    pub lr: f64,
    /// Mean cross-entropy of the steps since the last line, in nats.
    pub train_loss_nats: f64,
    /// L_u on the validation split.
    pub val_loss_normalised: f64,
}
