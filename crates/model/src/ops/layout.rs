//! [`SequenceLayout`] and [`CrossLayout`]: the rows of the sequences of a packed batch, and their attention masks.

use std::ops::Range;
use std::sync::Arc;

/// Why lengths and prefixes do not make a layout.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// One list is longer than the other.
    #[error("{lengths} sequence lengths but {prefixes} prefix lengths: give one prefix a sequence")]
    CountsDiffer { lengths: usize, prefixes: usize },
    /// A batch of nothing.
    #[error("a batch needs at least one sequence")]
    NoSequences,
    /// A sequence of no positions.
    #[error("sequence {sequence} of the batch is empty: leave it out")]
    EmptySequence { sequence: usize },
    /// A text prefix that does not fit its sequence.
    #[error(
        "sequence {sequence} of the batch has {length} positions, fewer than its text prefix \
         of {prefix}: shorten the prefix"
    )]
    PrefixTooLong { sequence: usize, prefix: usize, length: usize },
}

/// A batch packed without padding: sequence `i` takes the rows `rows(i)` of `[n_rows, d]`, its
/// first `prefix(i)` positions being text and the others motion.
///
/// Position q of a sequence sees position k of the same sequence iff
/// k <= q, or both lie in the prefix (ScaMo §3.2, `dataset_TM_train.py`), or both lie in one block of motion, if there
/// are blocks (the scales of a scale-causal mask). So q always sees the first [`visible`](Self::visible)
/// positions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SequenceLayout {
    /// First row of each sequence, then the number of rows: `[n_sequences + 1]`.
    offsets: Vec<usize>,
    /// Text positions of each sequence: `[n_sequences]`.
    prefixes: Vec<usize>,
    /// The ends of the blocks within each sequence; empty if each position of motion is one: `[n_sequences]`.
    blocks: Vec<Arc<[usize]>>,
    /// The angle of each row, as an index into a [`Rope`](super::Rope); empty if it is the position.
    angles: Vec<u32>,
}

/// A sequence whose motion comes in blocks that see one another whole, and all that lies before.
#[derive(Debug, Clone)]
pub struct BlockSequence {
    /// Text positions.
    pub prefix: usize,
    /// Positions of each block, at least one.
    pub blocks: Arc<[usize]>,
    /// The angle of each position, text first, as an index into a [`Rope`](super::Rope).
    pub angles: Vec<u32>,
}

impl SequenceLayout {
    /// Packs sequences of these lengths, prefixes included, in this order.
    ///
    /// # Errors
    ///
    /// [`LayoutError`] if the lists differ in length or are empty, or if a sequence is empty or
    /// shorter than its prefix.
    pub fn new(lengths: &[usize], prefixes: &[usize]) -> Result<Self, LayoutError> {
        if lengths.len() != prefixes.len() {
            let (lengths, prefixes) = (lengths.len(), prefixes.len());
            return Err(LayoutError::CountsDiffer { lengths, prefixes });
        }
        if lengths.is_empty() {
            return Err(LayoutError::NoSequences);
        }
        for (sequence, (&length, &prefix)) in lengths.iter().zip(prefixes).enumerate() {
            if length == 0 {
                return Err(LayoutError::EmptySequence { sequence });
            }
            if prefix > length {
                return Err(LayoutError::PrefixTooLong { sequence, prefix, length });
            }
        }
        let (offsets, blocks) = (offsets(lengths), vec![Arc::from([]); lengths.len()]);
        Ok(Self { offsets, prefixes: prefixes.to_vec(), blocks, angles: Vec::new() })
    }

    /// Packs sequences in blocks, in this order.
    ///
    /// # Errors
    ///
    /// [`LayoutError`] if there are none, or one is empty.
    ///
    /// # Panics
    ///
    /// If a sequence has not one angle a position.
    pub fn in_blocks(sequences: &[BlockSequence]) -> Result<Self, LayoutError> {
        let prefixes: Vec<usize> = sequences.iter().map(|sequence| sequence.prefix).collect();
        let ends = |sequence: &BlockSequence| -> Arc<[usize]> {
            let end = |end: &mut usize, length: &usize| {
                *end += length;
                Some(*end)
            };
            sequence.blocks.iter().scan(sequence.prefix, end).collect()
        };
        let blocks: Vec<Arc<[usize]>> = sequences.iter().map(ends).collect();
        let length = |(blocks, prefix): (&Arc<[usize]>, &usize)| *blocks.last().unwrap_or(prefix);
        let lengths: Vec<usize> = blocks.iter().zip(&prefixes).map(length).collect();
        let angles: Vec<u32> =
            sequences.iter().flat_map(|sequence| &sequence.angles).copied().collect();
        let layout = Self { blocks, ..Self::new(&lengths, &prefixes)? };
        assert_eq!(angles.len(), layout.n_rows(), "one angle a position");
        Ok(Self { angles, ..layout })
    }

    /// Rows of the packed batch: the sum of the lengths.
    pub fn n_rows(&self) -> usize {
        self.offsets[self.n_sequences()]
    }

    /// Number of sequences.
    #[inline]
    pub fn n_sequences(&self) -> usize {
        self.prefixes.len()
    }

    /// Rows of sequence `i`.
    #[inline]
    pub fn rows(&self, i: usize) -> Range<usize> {
        self.offsets[i]..self.offsets[i + 1]
    }

    /// Positions of sequence `i`, text and motion.
    #[inline]
    pub fn len(&self, i: usize) -> usize {
        self.rows(i).len()
    }

    /// Text positions of sequence `i`.
    #[inline]
    pub fn prefix(&self, i: usize) -> usize {
        self.prefixes[i]
    }

    /// Length of the longest sequence.
    pub fn max_len(&self) -> usize {
        (0..self.n_sequences()).map(|i| self.len(i)).max().unwrap_or(0)
    }

    /// The number of positions of sequence `i`, from its first on, visible to position `q`.
    #[inline]
    pub fn visible(&self, i: usize, q: usize) -> usize {
        let ends = &self.blocks[i];
        if q < self.prefix(i) {
            self.prefix(i)
        } else if ends.is_empty() {
            q + 1
        } else {
            ends[ends.partition_point(|&end| end <= q)]
        }
    }

    /// The first position of sequence `i` that sees position `k`.
    #[inline]
    pub fn first_viewer(&self, i: usize, k: usize) -> usize {
        let ends = &self.blocks[i];
        if k < self.prefix(i) {
            0
        } else if ends.is_empty() {
            k
        } else {
            let before = ends.partition_point(|&end| end <= k).checked_sub(1);
            before.map_or(self.prefix(i), |block| ends[block])
        }
    }

    /// Positions of each block of sequence `i`.
    pub fn block_lengths(&self, i: usize) -> Vec<usize> {
        let starts = std::iter::once(&self.prefixes[i]).chain(self.blocks[i].iter());
        starts.zip(self.blocks[i].iter()).map(|(start, end)| end - start).collect()
    }

    /// The angles of the positions of sequence `i`, as indices into a [`Rope`](super::Rope); `None` if they are the
    /// positions.
    #[inline]
    pub fn angles(&self, i: usize) -> Option<&[u32]> {
        (!self.angles.is_empty()).then(|| &self.angles[self.rows(i)])
    }

    /// One more than the largest angle.
    pub fn n_angles(&self) -> usize {
        self.angles.iter().max().map_or_else(|| self.max_len(), |&last| last as usize + 1)
    }
}

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

/// The start of each, then their sum.
fn offsets(counts: &[usize]) -> Vec<usize> {
    let ends = counts.iter().scan(0, |end, count| {
        *end += count;
        Some(*end)
    });
    std::iter::once(0).chain(ends).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_follow_one_another_and_cover_the_batch() {
        let layout = SequenceLayout::new(&[3, 1, 4], &[2, 0, 4]).unwrap();
        assert_eq!((0..3).map(|i| layout.rows(i)).collect::<Vec<_>>(), [0..3, 3..4, 4..8]);
        assert_eq!((layout.n_rows(), layout.n_sequences(), layout.max_len()), (8, 3, 4));
    }

    #[test]
    fn text_sees_all_text_and_motion_sees_what_came_before() {
        let layout = SequenceLayout::new(&[5], &[2]).unwrap();
        assert_eq!((0..5).map(|q| layout.visible(0, q)).collect::<Vec<_>>(), [2, 2, 3, 4, 5]);
    }

    #[test]
    fn a_block_sees_itself_and_what_came_before() {
        let sequence =
            BlockSequence { prefix: 2, blocks: [1, 3].into(), angles: vec![0, 1, 4, 3, 4, 5] };
        let layout = SequenceLayout::in_blocks(&[sequence.clone(), sequence]).unwrap();
        assert_eq!((0..6).map(|q| layout.visible(1, q)).collect::<Vec<_>>(), [2, 2, 3, 6, 6, 6]);
        let first: Vec<_> = (0..6).map(|k| layout.first_viewer(1, k)).collect();
        assert_eq!(first, [0, 0, 2, 3, 3, 3]);
        assert_eq!((layout.angles(1), layout.n_angles()), (Some(&[0, 1, 4, 3, 4, 5][..]), 6));
    }

    #[test]
    fn every_mistake_is_refused_and_named() {
        let refused = |lengths: &[usize], prefixes: &[usize]| {
            SequenceLayout::new(lengths, prefixes).unwrap_err().to_string()
        };
        assert!(refused(&[3], &[]).contains("1 sequence lengths but 0 prefix lengths"));
        assert!(refused(&[], &[]).contains("at least one sequence"));
        assert!(refused(&[3, 0], &[0, 0]).contains("sequence 1"));
        assert!(refused(&[3, 4], &[3, 5]).contains("text prefix of 5"));
    }
}
