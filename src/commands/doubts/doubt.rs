//! [`Doubt`]: something that will be in doubt.

use isoflop::laws::MinimumFlag;
use serde::Serialize;

/// What kind of doubt: the flag that a minimum would have, or one of the study as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum DoubtKind {
    Flag(MinimumFlag),
    Study(StudyDoubt),
}

/// A doubt of a study as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StudyDoubt {
    /// One budget.
    OneBudget,
    /// One seed of each run and of each tokenizer.
    OneSeed,
    /// A test split too small to measure a loss.
    SmallTest,
}

/// Something that will be in doubt: what, and what to change.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Doubt {
    pub kind: DoubtKind,
    pub what: String,
    #[serde(rename = "do")]
    pub mend: String,
    /// Those where it is so; empty where it does not depend on the budget.
    pub budgets_flops: Vec<f64>,
}

impl Doubt {
    pub fn flag(flag: MinimumFlag, what: String, mend: &str, budgets_flops: Vec<f64>) -> Self {
        Self { kind: DoubtKind::Flag(flag), what, mend: mend.to_string(), budgets_flops }
    }

    pub fn study(kind: StudyDoubt, what: String, mend: String) -> Self {
        Self { kind: DoubtKind::Study(kind), what, mend, budgets_flops: Vec::new() }
    }

    /// A line for a person: `gap: …; …`.
    pub fn sentence(&self) -> String {
        let kind = serde_json::to_value(self.kind).expect("a word");
        format!("{}: {}; {}", kind.as_str().unwrap_or_default(), self.what, self.mend)
    }
}

/// `at every budget`, `at 1e10 and 3e10 FLOPs`, `at 5 of 9 budgets`.
pub fn at(budgets: &[f64], all: usize) -> String {
    let written: Vec<String> = budgets.iter().map(|budget| format!("{budget:e}")).collect();
    match &written[..] {
        _ if budgets.len() == all && all > 1 => "at every budget".to_string(),
        [one] => format!("at {one} FLOPs"),
        [most @ .., last] if most.len() < 3 => format!("at {} and {last} FLOPs", most.join(", ")),
        _ => format!("at {} of {all} budgets", budgets.len()),
    }
}
