//! What running more would settle: `advice` of `laws.json`.

use serde::{Deserialize, Serialize};

/// What running more would settle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AdviceKind {
    /// Sizes past an edge of a budget's grid, or sizes where there are too few.
    AddSizes,
    /// Vocabularies past an edge of a budget's grid.
    AddVocabularies,
    /// Further seeds, where a curve is flat within its noise.
    AddSeeds,
    /// A further budget, since an exponent's interval is wide.
    LargerBudget,
    /// Where a further budget would be centred; nothing asks for it.
    NextBudget,
}

/// Runs that would tell more: every size with every vocabulary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    pub kind: AdviceKind,
    pub budget_flops: f64,
    /// N_nv of the runs; N where it is not told apart.
    pub params_nonvocab: Vec<f64>,
    /// V of the runs; empty where it is not known.
    pub n_vocab: Vec<f64>,
    /// Sizes × vocabularies × the sweep's runs of a cell.
    pub runs: usize,
    /// Their cost.
    pub flops: f64,
    /// The reason, for a person.
    pub why: String,
}
