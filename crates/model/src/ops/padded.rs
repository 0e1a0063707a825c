//! The layout of a padded batch as tensors: rows, masks and angles, made once a batch and not once a layer, since each
//! of them is a copy to the device.
//!
//! Shapes: n rows, b sequences, t positions of the longest sequence, c features of a head.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use burn::tensor::{Bool, Device, Int, Tensor, TensorData};

use super::{CrossLayout, Rope, SequenceLayout};

/// A value that belongs to options and to a device, made at its first use.
///
/// Another device than the first, or the same with or without autodiff, has it made at each use.
#[derive(Debug, Clone)]
pub struct Placed<T>(Arc<OnceLock<(Device, T)>>);

impl<T> Default for Placed<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T: Clone> Placed<T> {
    /// The value on a device.
    pub fn on(&self, device: &Device, make: impl Fn() -> T) -> T {
        let (first, value) = self.0.get_or_init(|| (device.clone(), make()));
        let is_first = first == device && first.is_autodiff() == device.is_autodiff();
        if is_first { value.clone() } else { make() }
    }
}

/// The layout of attention within sequences.
#[derive(Debug, Clone)]
pub struct PaddedBatch {
    /// The row of each position of the padded batch, `[b·t]`.
    pub rows: Tensor<1, Int>,
    /// The position in the padded batch of each row, `[n]`.
    pub positions: Tensor<1, Int>,
    /// Cosines and sines, `[b or 1, 1, t, c / 2, 1]`.
    pub turns: [Tensor<5>; 2],
    /// True for hidden pairs, `[b, 1, t, t]`.
    pub hidden: Tensor<4, Bool>,
}

impl PaddedBatch {
    /// That of packed sequences, on a device.
    pub fn new(layout: &SequenceLayout, rope: &Rope, device: &Device) -> Self {
        let sequences: Vec<_> = (0..layout.n_sequences()).map(|i| layout.rows(i)).collect();
        Self {
            rows: rows_of_padded(&sequences, device),
            positions: padded_of_rows(&sequences, device),
            turns: turns(rope, layout, device),
            hidden: hidden(layout, device),
        }
    }
}

/// The layout of attention to a memory.
#[derive(Debug, Clone)]
pub struct PaddedPair {
    pub queries: Padding,
    pub memory: Padding,
    /// True for padding of the memory, `[b, 1, 1, t]`; `None` without padding.
    pub hidden: Option<Tensor<4, Bool>>,
    /// Cosines and sines of the queries and of the memory, `[1, 1, t, c / 2, 1]`, if they are turned.
    pub turns: Option<[[Tensor<5>; 2]; 2]>,
}

impl PaddedPair {
    /// That of queries and their memories, on a device.
    pub fn new(layout: &CrossLayout, ropes: Option<&[Arc<Rope>; 2]>, device: &Device) -> Self {
        let queries: Vec<_> = layout.query_rows().collect();
        let memory: Vec<_> = layout.memory_rows().collect();
        let turns = |rope: &Rope, sequences: &[Range<usize>]| {
            rope.turns(1, &Vec::from_iter(0..longest(sequences)), device)
        };
        let turns = ropes.map(|[of_queries, of_memory]| {
            [turns(of_queries, &queries), turns(of_memory, &memory)]
        });
        let hidden = padding(&memory, device);
        let [queries, memory] = [queries, memory].map(|rows| Padding::of(&rows, device));
        Self { queries, memory, hidden, turns }
    }
}

/// How rows of sequences are padded to one length; `None` if they have one.
#[derive(Debug, Clone)]
pub struct Padding(Option<[Tensor<1, Int>; 2]>);

impl Padding {
    fn of(sequences: &[Range<usize>], device: &Device) -> Self {
        let indices = || [rows_of_padded(sequences, device), padded_of_rows(sequences, device)];
        Self((!is_even(sequences)).then(indices))
    }

    /// Pads the rows of sequences to one length with their first row.
    pub fn pad(&self, x_nd: Tensor<2>) -> Tensor<2> {
        match &self.0 {
            Some([rows, _]) => x_nd.select(0, rows.clone()),
            None => x_nd,
        }
    }

    /// Removes the padding of [`Padding::pad`].
    pub fn unpad(&self, x_nd: Tensor<2>) -> Tensor<2> {
        match &self.0 {
            Some([_, positions]) => x_nd.select(0, positions.clone()),
            None => x_nd,
        }
    }
}

/// Cosines and sines of the angles of each position of the padded batch, `[b, 1, t, c / 2, 1]`, or of
/// the first t, `[1, 1, t, c / 2, 1]`, where sequences have no others.
fn turns(rope: &Rope, layout: &SequenceLayout, device: &Device) -> [Tensor<5>; 2] {
    let (b, t) = (layout.n_sequences(), layout.max_len());
    if layout.angles(0).is_none() {
        return rope.turns(1, &Vec::from_iter(0..t), device);
    }
    let place = |(i, q): (usize, usize)| {
        let angles = layout.angles(i).expect("all sequences have them, or none");
        angles.get(q).map_or(0, |&angle| angle as usize)
    };
    let places: Vec<usize> = (0..b).flat_map(|i| (0..t).map(move |q| (i, q))).map(place).collect();
    rope.turns(b, &places, device)
}

/// Mask of the padded batch, true for hidden pairs: `[b, 1, t, t]`.
fn hidden(layout: &SequenceLayout, device: &Device) -> Tensor<4, Bool> {
    let (b, t) = (layout.n_sequences(), layout.max_len());
    // A padding position, visible to none, sees the first: no row may be fully hidden.
    let visible = |i: usize, q: usize| if q < layout.len(i) { layout.visible(i, q) } else { 1 };
    let visible = (0..b).flat_map(|i| (0..t).map(move |q| visible(i, q) as u32));
    let visible_b1t1 = integers(visible, device).reshape([b, 1, t, 1]);
    let keys_111t = integers(0..t as u32, device).reshape([1, 1, 1, t]);
    keys_111t.expand([b, 1, t, t]).greater_equal(visible_b1t1.expand([b, 1, t, t]))
}

/// The row of each position of sequences that are padded to one length; a sequence's first for padding.
fn rows_of_padded(sequences: &[Range<usize>], device: &Device) -> Tensor<1, Int> {
    let t = longest(sequences);
    let row = |rows: &Range<usize>, q| if q < rows.len() { rows.start + q } else { rows.start };
    integers(sequences.iter().flat_map(|rows| (0..t).map(move |q| row(rows, q) as u32)), device)
}

/// The position in the padded batch of each row.
fn padded_of_rows(sequences: &[Range<usize>], device: &Device) -> Tensor<1, Int> {
    let starts = (0..).step_by(longest(sequences));
    let own = |(start, rows): (usize, &Range<usize>)| {
        (start..start + rows.len()).map(|position| position as u32)
    };
    integers(starts.zip(sequences).flat_map(own), device)
}

/// True for padding rows of a memory, `[b, 1, 1, t]`; `None` without padding.
fn padding(sequences: &[Range<usize>], device: &Device) -> Option<Tensor<4, Bool>> {
    let t = longest(sequences);
    let hidden = |rows: &Range<usize>| (0..t).map(|i| i >= rows.len()).collect::<Vec<_>>();
    let hidden: Vec<bool> = sequences.iter().flat_map(hidden).collect();
    let data = TensorData::new(hidden, [sequences.len(), 1, 1, t]);
    (!is_even(sequences)).then(|| Tensor::from_data(data, device))
}

/// A row of indices.
pub fn integers(values: impl Iterator<Item = u32>, device: &Device) -> Tensor<1, Int> {
    let values: Vec<i64> = values.map(i64::from).collect();
    let n = values.len();
    Tensor::from_data(TensorData::new(values, [n]), device)
}

fn longest(sequences: &[Range<usize>]) -> usize {
    sequences.iter().map(Range::len).max().unwrap_or(0)
}

fn is_even(sequences: &[Range<usize>]) -> bool {
    sequences.iter().all(|rows| rows.len() == sequences[0].len())
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn a_value_is_made_once_for_its_device_and_not_lent_to_another() {
        let (made, placed) = (Cell::new(0), Placed::default());
        let on = |device: &Device| {
            placed.on(device, || {
                made.set(made.get() + 1);
                made.get()
            })
        };
        let (frozen, trained) = (Device::flex(), Device::flex().autodiff());
        assert_eq!([on(&trained), on(&trained)], [1, 1]);
        assert_eq!([on(&frozen), on(&frozen), on(&trained)], [2, 3, 1]);
    }
}
