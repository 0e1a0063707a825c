//! [`Rows`]: sequences of vectors, one after another.

use std::ops::Range;
use std::sync::Arc;

use crate::ops::SequenceLayout;

/// Sequences, each of one vector or more.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// `[rows of all sequences, channels]`, row-major.
    pub values: Vec<f32>,
    /// Rows of each sequence.
    pub lengths: Vec<usize>,
}

impl Rows {
    /// Sequences of vectors of so many channels.
    pub fn of<'a>(sequences: impl IntoIterator<Item = &'a [f32]>, channels: usize) -> Self {
        let mut rows = Self::default();
        for sequence in sequences {
            rows.values.extend_from_slice(sequence);
            rows.lengths.push(sequence.len() / channels);
        }
        rows
    }

    /// Sequences in which every row sees every other, with one more before the first.
    pub fn summarised(&self) -> Arc<SequenceLayout> {
        let lengths: Vec<usize> = self.lengths.iter().map(|length| length + 1).collect();
        Arc::new(SequenceLayout::new(&lengths, &lengths).expect("each has its summary"))
    }

    /// The rows of each sequence behind row `summary`, in the order of [`Rows::summarised`].
    pub fn order(&self, summary: u32) -> Arc<[u32]> {
        let of = |range: Range<u32>| std::iter::once(summary).chain(range);
        self.ranges().flat_map(of).collect()
    }

    /// Where each sequence's summary stands among those rows.
    pub fn summaries(&self) -> Arc<[u32]> {
        self.ranges().zip(0..).map(|(range, before)| range.start + before).collect()
    }

    fn ranges(&self) -> impl Iterator<Item = Range<u32>> {
        self.lengths.iter().scan(0, |end, length| {
            let start = *end;
            *end += *length as u32;
            Some(start..*end)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sequence_stands_behind_its_summary() {
        let rows = Rows::of([&[1.0, 2.0][..], &[3.0, 4.0, 5.0, 6.0]], 2);
        assert_eq!(rows.lengths, [1, 2]);
        assert_eq!(rows.order(3)[..], [3, 0, 3, 1, 2]);
        assert_eq!(rows.summaries()[..], [0, 2]);
        let layout = rows.summarised();
        assert_eq!((layout.n_rows(), layout.visible(1, 0)), (5, 3));
    }
}
