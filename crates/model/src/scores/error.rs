//! What no score can be taken of.

/// Why embeddings or motions have no score.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ScoreError {
    /// Values that are not rows of one width.
    #[error("{values} values are not rows of {dim} numbers each")]
    Ragged { values: usize, dim: usize },
    /// A value that is no number.
    #[error("embedding {row} holds a value that is no finite number")]
    NotFinite { row: usize },
    /// Two sets of different widths.
    #[error("embeddings of {left} and of {right} numbers come from different evaluators")]
    Widths { left: usize, right: usize },
    /// Pairs of which one half is missing.
    #[error("{texts} texts and {motions} motions make no pairs: give one motion a text")]
    Unpaired { texts: usize, motions: usize },
    /// Too few to say anything.
    #[error("{score} needs {least} {what} or more, there are {found}")]
    TooFew { score: &'static str, what: &'static str, least: usize, found: usize },
}

impl ScoreError {
    /// Whether there are as many things as a score needs.
    pub(super) fn unless_enough(
        score: &'static str,
        what: &'static str,
        least: usize,
        found: usize,
    ) -> Result<(), Self> {
        if found >= least { Ok(()) } else { Err(Self::TooFew { score, what, least, found }) }
    }
}
