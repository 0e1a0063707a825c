//! Convolutions over frames, a few rows at a time: the inputs of a row are concatenated, and multiplied by one weight
//! while they are in the cache.

use std::ops::Range;

use burn_flex::FlexTensor;

use super::buffers::{Buffer, chunks, dims, elements, part, part_mut};
use super::matmul::{Start, Target, multiply, multiply_transposed};
use super::panels::{Panels, View};
use super::rows::add_rows;
use super::{Above, Gradients, Operation};
use crate::ops::{Convolution, Taps};

/// Rows of a chunk: whole tiles of any kind.
const CHUNK: usize = 132;

/// The inputs of each output row in x `[n, c]`: k indices per row.
struct Reading<'a> {
    convolution: Convolution,
    x: &'a [f32],
    c: usize,
    /// Rows of x, tap by tap, row made after row made.
    sources: Vec<Option<usize>>,
}

impl<'a> Reading<'a> {
    fn new(convolution: Convolution, x: &'a [f32], c: usize) -> Self {
        let sources = match convolution.taps {
            Taps::Point => Vec::new(),
            _ => convolution.sources(x.len() / c).flatten().collect(),
        };
        Self { convolution, x, c, sources }
    }

    fn rows_out(&self) -> usize {
        self.convolution.rows_out(self.x.len() / self.c)
    }

    fn sources(&self, rows: &Range<usize>) -> &[Option<usize>] {
        let k = self.convolution.taps.count();
        &self.sources[rows.start * k..rows.end * k]
    }

    /// The inputs of `rows`, `[rows, k c]`: x itself, or concatenated in `room`.
    fn of<'b>(&'b self, rows: &Range<usize>, room: &'b mut [f32]) -> &'b [f32] {
        let rectify = self.convolution.rectify;
        match (self.convolution.taps, rectify) {
            (Taps::Point, false) => return part(self.x, rows, self.c),
            (Taps::Point, true) => {
                let x = part(self.x, rows, self.c);
                room.iter_mut().zip(x).for_each(|(to, x)| *to = rectified(*x));
            }
            _ => {
                for (&source, to) in self.sources(rows).iter().zip(room.chunks_exact_mut(self.c)) {
                    match source.map(|row| &self.x[row * self.c..][..self.c]) {
                        None => to.fill(0.0),
                        Some(x) if rectify => {
                            to.iter_mut().zip(x).for_each(|(to, x)| *to = rectified(*x));
                        }
                        Some(x) => to.copy_from_slice(x),
                    }
                }
            }
        }
        room
    }

    /// Adds the gradients by the inputs of `rows` to those by x.
    fn give_back(&self, rows: &Range<usize>, by_taps: &[f32], by_x: &mut [f32]) {
        for (&source, from) in self.sources(rows).iter().zip(by_taps.chunks_exact(self.c)) {
            let Some(row) = source else { continue };
            add_rows(&mut by_x[row * self.c..][..self.c], from);
        }
    }
}

/// A convolution, of x `[n, c]`, W `[k c, o]` and b; see
/// [`Kernels::convolve`](crate::ops::Kernels::convolve).
impl Operation<3> for Convolution {
    type Kept = [FlexTensor; 3];

    fn forward(&self, inputs: &[FlexTensor; 3], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let ([x, weight, bias], [kc, o]) = (inputs.each_ref().map(elements), dims(&inputs[1]));
        let reading = Reading::new(*self, x, kc / self.taps.count());
        let panels = Panels::of(View::new(weight, o), kc, o);
        let n = reading.rows_out();
        let (mut output, mut room) = (Buffer::new(n * o), Buffer::new(CHUNK * kc));
        for rows in chunks(n, CHUNK) {
            let taps = reading.of(&rows, &mut room);
            let output = part_mut(&mut output, &rows, o);
            let (target, taps) = (Target::new(output, o), View::new(taps, kc));
            multiply(target, rows.len(), taps, &panels, Start::Rows(View::new(bias, 0)));
        }
        (output.into_tensor([n, o]), keep.then(|| inputs.clone()))
    }

    fn backward(&self, inputs: Self::Kept, (gradient, [wants_x, ..]): Above<3>) -> Gradients<3> {
        let ([x, weight, _], [kc, o]) = (inputs.each_ref().map(elements), dims(&inputs[1]));
        let reading = Reading::new(*self, x, kc / self.taps.count());
        let back = Panels::of(View::new(weight, o).transposed(), o, kc);
        let mut by_x = wants_x.then(|| match self.taps {
            Taps::Point => Buffer::new(x.len()),
            _ => Buffer::zeros(x.len()),
        });
        let (mut by_weight, mut by_bias) = (Buffer::new(kc * o), Buffer::zeros(o));
        let (mut room, mut panels) = (Buffer::new(CHUNK * kc), Panels::default());
        for rows in chunks(reading.rows_out(), CHUNK) {
            let (count, change) = (rows.len(), part(elements(&gradient), &rows, o));
            add_rows(&mut by_bias, change);
            let (taps, change) =
                (View::new(reading.of(&rows, &mut room), kc), View::new(change, o));
            let target = Target::new(&mut by_weight, o);
            multiply_transposed(target, (kc, o), taps, change, &rows, &mut panels);
            let Some(by_x) = &mut by_x else { continue };
            if self.taps == Taps::Point {
                let by_x = part_mut(by_x, &rows, kc);
                multiply(Target::new(by_x, kc), count, change, &back, Start::Zero);
            } else {
                multiply(Target::new(&mut room, kc), count, change, &back, Start::Zero);
                reading.give_back(&rows, &room, by_x);
            }
        }
        if let (true, Some(by_x)) = (self.rectify, &mut by_x) {
            by_x.iter_mut().zip(x).for_each(|(by, x)| *by = if *x <= 0.0 { 0.0 } else { *by });
        }
        let by_x = by_x.map(|by_x| by_x.into_tensor(dims(&inputs[0])));
        [by_x, Some(by_weight.into_tensor([kc, o])), Some(by_bias.into_tensor([o]))]
    }
}

/// max(x, 0) that keeps NaN: `f32::max` would hide it.
fn rectified(x: f32) -> f32 {
    if x < 0.0 { 0.0 } else { x }
}
