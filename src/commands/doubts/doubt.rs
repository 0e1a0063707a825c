//! [`Doubt`]: something that will be in doubt.

use serde::Serialize;

/// Something that will be in doubt: what, and what to change.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Doubt {
    /// The flag that a minimum would have, or the word for a doubt of the study as a whole.
    pub kind: &'static str,
    pub what: String,
    #[serde(rename = "do")]
    pub mend: String,
    /// Those where it is so; empty if it does not depend on the budget.
    pub budgets_flops: Vec<f64>,
}

impl Doubt {
    /// A line for a person: `gap: …; …`.
    pub fn sentence(&self) -> String {
        format!("{}: {}; {}", self.kind, self.what, self.mend)
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
