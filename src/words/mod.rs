//! Laws and predictions in words, for a terminal.

pub mod fit;
pub mod number;
pub mod prediction;
mod wrap;

pub use wrap::{fit_to_terminal, wrap};

/// A list of sentences under a heading; empty without sentences.
fn listed(heading: &str, sentences: impl Iterator<Item = String>) -> String {
    let list: String = sentences.map(|sentence| wrap("  - ", &sentence)).collect();
    if list.is_empty() { list } else { format!("\n{heading}\n{list}") }
}

#[cfg(test)]
mod tests;
