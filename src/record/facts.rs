//! The facts of a finished run, each declared once.
//!
//! A line has the group of the fact (`planned`, `measured` or `loss`), its name and its type. The order is that of the
//! table's columns, so a new fact is appended. A new fact is an `Option`, since older records lack it. Other types
//! are required: a record that lacks one of them, or every loss, is damaged.

use serde::{Deserialize, Serialize};

use crate::laws;
use crate::spec::FlopsRule;

/// The type of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellKind {
    /// A whole number from 0.
    Count,
    Number,
    Text,
}

/// A column of the table.
#[derive(Clone, Copy, Debug)]
pub struct FactColumn {
    /// The name in the table and in `record.json`.
    pub name: &'static str,
    pub kind: CellKind,
    /// Whether a row without a value is damaged.
    pub is_required: bool,
}

/// Makes of one list of facts the structs [`Planned`] and [`Measured`], a constant for each loss and their
/// list, and the columns of the table.
///
/// A line is `planned name: Type,`, `measured name: Type,` or `loss NAME = "name",`. The macro takes a
/// line off the list at a time and puts it into one of four heaps: fields of each struct, losses,
/// columns.
macro_rules! facts {
    (@heap {$($planned:tt)*} {$($measured:tt)*}
     {$($(#[$doc:meta])* $loss:ident = $name:expr;)*} {$($columns:tt)*}) => {
        /// Facts that the plan of a run holds before it starts.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct Planned { $($planned)* }

        /// Facts from training: the run's cost, device and data.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        pub struct Measured { $($measured)* }

        $($(#[$doc])* pub const $loss: &str = $name;)*

        /// The metrics that are a loss; a record holds at least one of them.
        pub const LOSSES: &[&str] = &[$($loss),*];

        /// The columns of the table, in its order.
        pub const COLUMNS: &[FactColumn] = &[$($columns)*];
    };
    (@heap {$($planned:tt)*} $measured:tt $losses:tt {$($columns:tt)*}
     $(#[$doc:meta])* planned $name:ident: $type:ident $(<$of:ident>)?, $($rest:tt)*) => {
        facts! {
            @heap {$($planned)* $(#[$doc])* pub $name: $type $(<$of>)?,} $measured $losses
            {$($columns)* facts!(@column $name $type $(<$of>)?),} $($rest)*
        }
    };
    (@heap $planned:tt {$($measured:tt)*} $losses:tt {$($columns:tt)*}
     $(#[$doc:meta])* measured $name:ident: $type:ident $(<$of:ident>)?, $($rest:tt)*) => {
        facts! {
            @heap $planned {$($measured)* $(#[$doc])* pub $name: $type $(<$of>)?,} $losses
            {$($columns)* facts!(@column $name $type $(<$of>)?),} $($rest)*
        }
    };
    (@heap $planned:tt $measured:tt {$($losses:tt)*} {$($columns:tt)*}
     $(#[$doc:meta])* loss $loss:ident = $name:expr, $($rest:tt)*) => {
        facts! {
            @heap $planned $measured {$($losses)* $(#[$doc])* $loss = $name;}
            {$($columns)* facts!(@metric $loss),} $($rest)*
        }
    };
    // One that is no `Option` is required.
    (@column $name:ident Option<$type:ident>) => {
        FactColumn { name: stringify!($name), kind: facts!(@kind $type), is_required: false }
    };
    (@column $name:ident $type:ident) => {
        FactColumn { name: stringify!($name), kind: facts!(@kind $type), is_required: true }
    };
    (@kind f64) => { CellKind::Number };
    (@kind String) => { CellKind::Text };
    (@kind $count:ident) => { CellKind::Count };
    (@metric $name:ident) => {
        FactColumn { name: $name, kind: CellKind::Number, is_required: false }
    };
    ($($facts:tt)*) => {
        facts! { @heap {} {} {} {} $($facts)* }
    };
}

/// The metric that holds L_u on a block of the test split, counted from 0: a part of it that has no
/// recording in common with the others.
pub fn block_metric(block: usize) -> String {
    format!("{LOSS_NORMALISED}_block_{:02}", block + 1)
}

impl Measured {
    /// Training FLOPs achieved, by a rule.
    pub fn flops_mut(&mut self, rule: FlopsRule) -> &mut Option<f64> {
        match rule {
            FlopsRule::OpenAi => &mut self.flops_openai,
            FlopsRule::SixNd => &mut self.flops_6nd,
            FlopsRule::Exact => &mut self.flops_exact,
        }
    }
}

facts! {
    /// Hash of the resolved spec, the data's digest, the tokenizer's id and the training revision.
    planned run_id: String,
    planned seed: Option<u64>,
    planned n_layer: Option<usize>,
    planned n_head: Option<usize>,
    planned d_model: Option<usize>,
    /// The true width of the feed-forward layer as built.
    planned d_ff: Option<usize>,
    /// Positions of the FLOP rule: text prefix and motion slots.
    planned n_ctx: Option<usize>,
    /// Codes, without special tokens (V).
    planned n_vocab: usize,
    /// The budget that the sweep declared (C).
    planned budget_flops: f64,
    /// Training FLOPs achieved, by ScaMo's Code 1.
    measured flops_openai: Option<f64>,
    /// 6 (N_nv + N_v) D.
    measured flops_6nd: Option<f64>,
    /// Multiply-adds of the model as built, prefix positions included, times two, times three.
    measured flops_exact: Option<f64>,
    /// Blocks and norms that a code goes through (N_nv).
    planned params_nonvocab: usize,
    /// V·d (N_v).
    planned params_vocab: usize,
    /// The projection of the text embeddings.
    planned params_text: Option<usize>,
    /// The embedding table as built, special tokens included.
    planned params_embedding: Option<usize>,
    /// The output head as built; zero if it is tied to the embedding.
    planned params_head: Option<usize>,
    /// Supervised motion tokens, end tokens included (D).
    measured tokens: usize,
    /// Distinct supervised tokens in the training split.
    measured unique_tokens: Option<usize>,
    /// `tokens / unique_tokens`.
    measured epochs: Option<f64>,
    planned steps: Option<usize>,
    /// Supervised tokens in a step.
    planned batch_tokens: Option<usize>,
    planned lr: Option<f64>,
    /// Cross-entropy on the test split, per supervised token.
    loss LOSS_NATS = "loss_nats",
    /// L_u: cross-entropy minus the unigram model's on the same targets.
    loss LOSS_NORMALISED = laws::LOSS_NORMALISED,
    /// Cross-entropy per frame of motion; does not depend on V.
    loss NATS_PER_FRAME = "nats_per_frame",
    /// Cross-entropy per second of motion; does not depend on V.
    loss NATS_PER_SECOND = "nats_per_second",
    /// Test targets whose code the training split never showed.
    measured zero_count_targets: Option<usize>,
    measured wall_s: Option<f64>,
    measured tokens_per_s: Option<f64>,
    /// The most memory that the run had to itself: mapped files are shared, and left out.
    measured peak_bytes: Option<u64>,
    planned tokenizer_id: Option<String>,
    measured device: Option<String>,
    measured git_revision: Option<String>,
    /// The kind of model: `autoregressive`.
    planned generator: Option<String>,
    /// The kind of tokenizer: `convolutional`. Null if the sweep has no data.
    planned tokenizer_kind: Option<String>,
    /// The quantizer: `fsq` or `vq`. Null if the sweep has no data.
    planned quantizer: Option<String>,
    /// Its values of varied keys: `train.lr=0.001`. Null if none vary.
    planned varied: Option<String>,
    /// The fraction of the training split's clips used, 1 for all. Null in older records, which used all.
    planned share: Option<f64>,
}
