//! Laws and predictions in words, for a terminal.

pub mod fit;
pub mod prediction;
mod wrap;

pub use wrap::{fit_to_terminal, wrap};

#[cfg(test)]
mod tests;
