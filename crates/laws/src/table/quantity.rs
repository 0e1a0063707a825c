//! The quantities that a column can stand for.

use std::fmt;
use std::str::FromStr;

use super::nearest::{UnknownName, name_of, named};

/// What a column of a table can be, by the names of `--columns`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quantity {
    /// N, where the vocabulary is not told apart.
    Params,
    /// N_nv.
    ParamsNonvocab,
    /// N_v = V·d.
    ParamsVocab,
    /// V.
    NVocab,
    /// d, the model's width.
    DModel,
    /// D, the tokens trained on.
    Tokens,
    /// C as declared: rows are grouped by it.
    BudgetFlops,
    /// What the run spent, where that differs from the declared budget.
    Flops,
    /// The loss to fit.
    Loss,
    /// Tells repeats of one configuration apart.
    Seed,
    /// How much the row counts.
    Weight,
    /// Distinct tokens of what the run was trained on.
    UniqueTokens,
    /// What it saw of the data, 1 being all.
    Share,
    /// What messages call the row.
    RunId,
}

impl Quantity {
    /// Every quantity with its name.
    pub const ALL: [(&'static str, Self); 14] = [
        ("params", Self::Params),
        ("params_nonvocab", Self::ParamsNonvocab),
        ("params_vocab", Self::ParamsVocab),
        ("n_vocab", Self::NVocab),
        ("d_model", Self::DModel),
        ("tokens", Self::Tokens),
        ("budget_flops", Self::BudgetFlops),
        ("flops", Self::Flops),
        ("loss", Self::Loss),
        ("seed", Self::Seed),
        ("weight", Self::Weight),
        ("unique_tokens", Self::UniqueTokens),
        ("share", Self::Share),
        ("run_id", Self::RunId),
    ];

    /// The name of `--columns`.
    pub fn name(self) -> &'static str {
        name_of(&self, &Self::ALL)
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Quantity {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        named("quantity", name, &Self::ALL)
    }
}
