//! [`Batch`]: sequences packed row after row, without padding.

use std::sync::Arc;

use crate::ops::SequenceLayout;

/// One text prefix and the codes after it, of which a range is supervised.
#[derive(Clone, Copy, Debug)]
pub struct Sequence<'a> {
    /// Frozen text vectors, `[n_text, d_text]` row-major, at least one row.
    pub text: &'a [f32],
    /// The clip's codes, without the end token.
    pub codes: &'a [u32],
    /// First supervised target; target i is code i, and the last one is the end token.
    pub from: usize,
    /// One past the last supervised target, at most `codes.len() + 1`, or `codes.len()` where clips have
    /// no end token.
    pub to: usize,
}

/// A batch as the model takes it.
///
/// Sequence i takes rows `[text | codes]`: its last text row predicts its first code, each code's
/// row the next code, the last code's row the end token. Rows after the last supervised target are
/// left out, since nothing supervised depends on them.
#[derive(Clone, Debug)]
pub struct Batch {
    pub layout: Arc<SequenceLayout>,
    /// `[n_text_rows, d_text]`, all prefixes after one another.
    pub text: Vec<f32>,
    /// Codes of all motion rows.
    pub codes: Arc<[u32]>,
    /// For each row of the batch, where it comes from: a text row, or `n_text_rows` + a code.
    pub order: Arc<[u32]>,
    /// Rows that predict a supervised target.
    pub target_rows: Arc<[u32]>,
    /// What they should predict, in `0..=V`.
    pub targets: Arc<[u32]>,
}

impl Batch {
    /// Packs sequences; `end` is the id of the end token, V.
    pub fn pack(sequences: &[Sequence], d_text: usize, end: u32) -> Self {
        let n_text_rows: usize = sequences.iter().map(|s| s.text.len() / d_text).sum();
        let (mut text, mut codes) = (Vec::with_capacity(n_text_rows * d_text), Vec::new());
        let (mut order, mut target_rows, mut targets) = (Vec::new(), Vec::new(), Vec::new());
        let (mut lengths, mut prefixes) = (Vec::new(), Vec::new());
        for sequence in sequences {
            let start = order.len();
            let prefix = sequence.text.len() / d_text;
            let inputs = &sequence.codes[..sequence.to - 1];
            let first_text = (text.len() / d_text) as u32;
            order.extend(first_text..first_text + prefix as u32);
            let first_code = (n_text_rows + codes.len()) as u32;
            order.extend(first_code..first_code + inputs.len() as u32);
            text.extend_from_slice(sequence.text);
            codes.extend_from_slice(inputs);
            lengths.push(prefix + inputs.len());
            prefixes.push(prefix);
            for target in sequence.from..sequence.to {
                target_rows.push((start + prefix - 1 + target) as u32);
                targets.push(sequence.codes.get(target).copied().unwrap_or(end));
            }
        }
        let layout = SequenceLayout::new(&lengths, &prefixes).expect("prefixes are not empty");
        Self {
            layout: Arc::new(layout),
            text,
            codes: codes.into(),
            order: order.into(),
            target_rows: target_rows.into(),
            targets: targets.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_targets_of_two_sequences() {
        let whole = Sequence { text: &[1.0, 2.0], codes: &[5, 6], from: 0, to: 3 };
        let part = Sequence { text: &[3.0], codes: &[7, 8, 9], from: 1, to: 2 };
        let batch = Batch::pack(&[whole, part], 1, 99);
        assert_eq!(batch.text, [1.0, 2.0, 3.0]);
        assert_eq!(*batch.codes, [5, 6, 7]);
        assert_eq!(*batch.order, [0, 1, 3, 4, 2, 5]);
        assert_eq!(*batch.target_rows, [1, 2, 3, 5]);
        assert_eq!(*batch.targets, [5, 6, 99, 8]);
        assert_eq!((batch.layout.n_rows(), batch.layout.n_sequences()), (6, 2));
    }
}
