//! [`CrossLayout`]: which rows of a packed batch look at which others.

use std::ops::Range;
use std::sync::Arc;

use super::Rope;

/// A batch of sequences, each with queries and with a memory that all of them see whole; both are packed
/// without padding, sequence after sequence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CrossLayout {
    /// First query of each sequence, then the number of queries.
    queries: Vec<usize>,
    /// First row of each sequence's memory, then the number of rows.
    memory: Vec<usize>,
}

impl CrossLayout {
    /// Packs sequences of so many queries, and of so many rows of memory.
    ///
    /// # Panics
    ///
    /// If the lists differ in length or are empty, or a sequence has no query or no memory.
    pub fn new(queries: &[usize], memory: &[usize]) -> Self {
        assert_eq!(queries.len(), memory.len(), "cross_attend: a memory for each sequence");
        assert!(!queries.is_empty(), "cross_attend: no sequences");
        let all = queries.iter().chain(memory);
        assert!(all.clone().all(|&n| n > 0), "cross_attend: a sequence is empty");
        Self { queries: offsets(queries), memory: offsets(memory) }
    }

    /// Number of sequences.
    #[inline]
    pub fn n_sequences(&self) -> usize {
        self.queries.len() - 1
    }

    /// Number of queries.
    pub fn n_queries(&self) -> usize {
        self.queries[self.n_sequences()]
    }

    /// Rows of the memory.
    pub fn n_memory(&self) -> usize {
        self.memory[self.n_sequences()]
    }

    /// Queries of sequence `i`.
    #[inline]
    pub fn queries(&self, i: usize) -> Range<usize> {
        self.queries[i]..self.queries[i + 1]
    }

    /// The memory of sequence `i`.
    #[inline]
    pub fn memory(&self, i: usize) -> Range<usize> {
        self.memory[i]..self.memory[i + 1]
    }

    /// Queries of each sequence.
    pub fn query_rows(&self) -> impl ExactSizeIterator<Item = Range<usize>> + Clone {
        (0..self.n_sequences()).map(|i| self.queries(i))
    }

    /// The memory of each sequence.
    pub fn memory_rows(&self) -> impl ExactSizeIterator<Item = Range<usize>> + Clone {
        (0..self.n_sequences()).map(|i| self.memory(i))
    }
}

/// Where each of so many begins, then their sum.
pub(super) fn offsets(counts: &[usize]) -> Vec<usize> {
    let ends = counts.iter().scan(0, |end, count| {
        *end += count;
        Some(*end)
    });
    std::iter::once(0).chain(ends).collect()
}

/// What attention to a memory is told beside its tensors.
#[derive(Debug, Clone)]
pub struct CrossOptions {
    pub n_head: usize,
    pub layout: Arc<CrossLayout>,
    /// Angles of the queries of a sequence, and of the rows of its memory; none are turned without.
    pub ropes: Option<[Arc<Rope>; 2]>,
}
