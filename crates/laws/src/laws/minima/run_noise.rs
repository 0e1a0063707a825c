//! [`RunNoise`]: the scatter of single runs.

use serde::{Deserialize, Serialize};

/// Where the scatter of single runs was read off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseSource {
    /// Runs of one cell around their mean.
    Seeds,
    /// Runs of one cell with several tokenizers, less what each tokenizer moves all its runs by; over
    /// the better half of each budget's cells.
    Tokenizers,
    /// Cells around a polynomial of this degree over each budget's grid.
    Surface { degree: usize },
}

/// The scatter of single runs, pooled over the fitted budgets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunNoise {
    /// Standard deviation of one run's loss, in nats.
    pub sd: f64,
    /// Degrees of freedom of its square.
    pub dof: usize,
    pub source: NoiseSource,
}
