//! [`Order`]: sequences side by side, row after row, for a recurrence.

use std::sync::Arc;

use burn::tensor::{Device, Tensor, TensorData};

/// Sequences of different lengths, of which a recurrence reads the t-th rows together.
#[derive(Clone, Debug)]
pub struct Order {
    /// The first row of each sequence, and how many it has.
    sequences: Vec<(usize, usize)>,
}

impl Order {
    /// Sequences that stand one after another.
    pub fn packed(lengths: &[usize]) -> Self {
        let start = |end: &mut usize, length: &usize| {
            let start = *end;
            *end += length;
            Some((start, *length))
        };
        Self { sequences: lengths.iter().scan(0, start).collect() }
    }

    /// Sequences that stand `stride` rows apart.
    pub fn padded(lengths: &[usize], stride: usize) -> Self {
        let at = |(i, length): (usize, &usize)| (i * stride, *length);
        Self { sequences: lengths.iter().enumerate().map(at).collect() }
    }

    /// Sequences.
    pub fn len(&self) -> usize {
        self.sequences.len()
    }

    /// Rows of the longest sequence.
    pub fn steps(&self) -> usize {
        self.sequences.iter().map(|(_, length)| *length).max().unwrap_or(0)
    }

    /// The rows of all first steps, then of all second ones, and so on: what stands behind the end of a
    /// sequence is its last row.
    pub fn forwards(&self) -> Arc<[u32]> {
        self.rows(|step, start, length| start + step.min(length - 1))
    }

    /// The same from the end of each sequence to its start.
    pub fn backwards(&self) -> Arc<[u32]> {
        self.rows(|step, start, length| start + (length - 1).saturating_sub(step))
    }

    fn rows(&self, row: impl Fn(usize, usize, usize) -> usize) -> Arc<[u32]> {
        let of = |step| self.sequences.iter().map(move |(start, length)| (step, *start, *length));
        let all = (0..self.steps()).flat_map(of);
        all.map(|(step, start, length)| row(step, start, length) as u32).collect()
    }

    /// Which sequences go on at a step, 1 or 0, `[n, 1]`; `None` where all do.
    pub fn going_on(&self, step: usize, device: &Device) -> Option<Tensor<2>> {
        let goes = |(_, length): &(usize, usize)| f32::from(u8::from(step < *length));
        let values: Vec<f32> = self.sequences.iter().map(goes).collect();
        let ended = values.contains(&0.0);
        ended.then(|| Tensor::from_data(TensorData::new(values, [self.len(), 1]), device))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sequence_is_read_from_either_end() {
        let packed = Order::packed(&[3, 1]);
        assert_eq!((packed.len(), packed.steps()), (2, 3));
        assert_eq!(packed.forwards()[..], [0, 3, 1, 3, 2, 3]);
        assert_eq!(packed.backwards()[..], [2, 3, 1, 3, 0, 3]);
        let padded = Order::padded(&[3, 1], 4);
        assert_eq!(padded.backwards()[..], [2, 4, 1, 4, 0, 4]);
        let device = Device::flex();
        assert!(packed.going_on(0, &device).is_none());
        let second: Vec<f32> = packed.going_on(1, &device).unwrap().into_data().iter().collect();
        assert_eq!(second, [1.0, 0.0]);
    }
}
