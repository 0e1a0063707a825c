//! Attention from queries to a memory: every query of a sequence sees all rows of its memory.

use burn_flex::FlexTensor;

use super::heads::{Angles, HeadRows, Sight, rotate, rotate_back};
use super::tiles::{
    Statistics, Workspace, differentiate, load_gradient, mix, sum_by_keys_and_values,
};
use crate::ops::own::buffers::{Buffer, dims, elements};
use crate::ops::own::lanes::Lanes;
use crate::ops::own::small_matrices::tile_rows;
use crate::ops::own::vectors::vectorised;
use crate::ops::own::{Above, Gradients, Operation};
use crate::ops::{CrossLayout, CrossOptions, Rope};

/// The layout of heads and sequences in rows of queries `[n, d]` and of a memory `[k | v]`, `[m, 2 d]`.
#[derive(Clone, Copy)]
struct CrossHeads<'a> {
    layout: &'a CrossLayout,
    n_head: usize,
    head_dim: usize,
    /// The sequences of the queries, and of the memory.
    ropes: Option<[&'a Rope; 2]>,
}

/// One head of one sequence.
#[derive(Clone, Copy)]
struct CrossHead<'a> {
    heads: CrossHeads<'a>,
    sequence: usize,
    head: usize,
}

impl<'a> CrossHeads<'a> {
    fn d_model(&self) -> usize {
        self.n_head * self.head_dim
    }

    /// Every head of every sequence, in the order of their rows.
    fn each(self) -> impl Iterator<Item = CrossHead<'a>> {
        (0..self.layout.n_sequences()).flat_map(move |sequence| {
            (0..self.n_head).map(move |head| CrossHead { heads: self, sequence, head })
        })
    }
}

impl<'a> CrossHead<'a> {
    /// The place of the head's queries, and of its output, in `[n, d]`.
    #[inline(always)]
    fn queries(&self) -> HeadRows {
        let (row, stride) = (self.heads.layout.queries(self.sequence).start, self.heads.d_model());
        HeadRows { start: row * stride + self.column(), stride, columns: self.heads.head_dim }
    }

    /// The place of its keys (part 0) or values (part 1) in `[m, 2 d]`.
    #[inline(always)]
    fn memory(&self, part: usize) -> HeadRows {
        let (row, d) = (self.heads.layout.memory(self.sequence).start, self.heads.d_model());
        let start = row * 2 * d + part * d + self.column();
        HeadRows { start, stride: 2 * d, columns: self.heads.head_dim }
    }

    fn column(&self) -> usize {
        self.head * self.heads.head_dim
    }

    /// The angles of queries, and of keys.
    #[inline(always)]
    fn angles(&self) -> [Option<Angles<'a>>; 2] {
        let listed = |rope| Angles { rope, listed: None };
        self.heads.ropes.map_or([None; 2], |ropes| ropes.map(|rope| Some(listed(rope))))
    }
}

impl Sight for CrossHead<'_> {
    #[inline(always)]
    fn head_dim(&self) -> usize {
        self.heads.head_dim
    }

    #[inline(always)]
    fn n_queries(&self) -> usize {
        self.heads.layout.queries(self.sequence).len()
    }

    #[inline(always)]
    fn n_keys(&self) -> usize {
        self.heads.layout.memory(self.sequence).len()
    }

    #[inline(always)]
    fn visible(&self, _: usize) -> usize {
        self.n_keys()
    }

    #[inline(always)]
    fn first_viewer(&self, _: usize) -> usize {
        0
    }
}

impl CrossOptions {
    /// The heads that they speak of, of `d` columns.
    fn heads(&self, d: usize) -> CrossHeads<'_> {
        let ropes = self.ropes.as_ref().map(|ropes| ropes.each_ref().map(|rope| &**rope));
        let Self { n_head, layout, .. } = self;
        CrossHeads { layout, n_head: *n_head, head_dim: d / n_head, ropes }
    }
}

/// Attention to a memory, of queries and `[k | v]`; keeps its inputs and the statistics to recompute its weights.
/// See [`Kernels::cross_attend`](crate::ops::Kernels::cross_attend).
impl Operation<2> for CrossOptions {
    type Kept = ([FlexTensor; 2], Buffer);

    fn forward(&self, inputs: &[FlexTensor; 2], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let [queries, memory] = inputs.each_ref().map(elements);
        let shape = dims(&inputs[0]);
        let mut mixed = Buffer::new(queries.len());
        let n_kept = Statistics::PER_ROW * self.n_head * self.layout.n_queries();
        let mut statistics = Buffer::new(if keep { n_kept } else { 0 });
        forward(queries, memory, self.heads(shape[1]), &mut mixed, keep, &mut statistics);
        (mixed.into_tensor(shape), keep.then(|| (inputs.clone(), statistics)))
    }

    fn backward(&self, (inputs, statistics): Self::Kept, (gradient, _): Above<2>) -> Gradients<2> {
        let [queries, memory] = inputs.each_ref().map(elements);
        let ([of_queries, of_memory], change) = (inputs.each_ref().map(dims), elements(&gradient));
        let [mut by_queries, mut by_memory] = [queries, memory].map(|x| Buffer::new(x.len()));
        let heads = self.heads(of_queries[1]);
        backward(queries, memory, heads, &statistics, change, &mut by_queries, &mut by_memory);
        [by_queries.into_tensor(of_queries), by_memory.into_tensor(of_memory)].map(Some)
    }
}

vectorised! {
    fn forward(
        queries: &[f32],
        memory: &[f32],
        heads: CrossHeads<'_>,
        output: &mut [f32],
        keep: bool,
        kept: &mut [f32],
    ) {
        let (mut room, mut work) = (kept, Workspace::default());
        for head in heads.each() {
            read::<L>(&mut work, queries, memory, head);
            mix::<L>(&mut work, &head, (&mut *output, head.queries()), keep, &mut room);
        }
    }
}

vectorised! {
    fn backward(
        queries: &[f32],
        memory: &[f32],
        heads: CrossHeads<'_>,
        kept: &[f32],
        gradient: &[f32],
        by_queries: &mut [f32],
        by_memory: &mut [f32],
    ) {
        let (mut kept, mut work) = (kept, Workspace::default());
        for head in heads.each() {
            let [of_queries, of_keys] = head.angles();
            read::<L>(&mut work, queries, memory, head);
            load_gradient::<L>(&mut work, (gradient, head.queries()), &head);
            for first in (0..head.n_queries()).step_by(tile_rows::<L>()) {
                differentiate::<L>(&mut work, &head, first, &mut kept);
                let (to, rows) = ((&mut *by_queries, head.queries()), head.rows::<L>(first));
                rotate_back::<L>(to, &work.grad_queries, rows, of_queries, head.scale());
            }
            sum_by_keys_and_values::<L>(&mut work, &head);
            let (keys, rows) = ((&mut *by_memory, head.memory(0)), 0..head.n_keys());
            rotate_back::<L>(keys, &work.grad_keys, rows.clone(), of_keys, 1.0);
            let values = (&mut *by_memory, head.memory(1));
            rotate_back::<L>(values, &work.grad_values, rows, None, 1.0);
        }
    }
}

/// Reads one head.
#[inline(always)]
fn read<L: Lanes>(work: &mut Workspace, queries: &[f32], memory: &[f32], head: CrossHead<'_>) {
    let (n, m, head_dim) = (head.n_queries(), head.n_keys(), head.head_dim());
    let [of_queries, of_keys] = head.angles();
    work.queries.resize::<L>(n, head_dim);
    work.keys.resize::<L>(m, head_dim);
    work.values.resize::<L>(m, head_dim);
    rotate::<L>(&mut work.queries, (queries, head.queries()), 0..n, of_queries, head.scale());
    rotate::<L>(&mut work.keys, (memory, head.memory(0)), 0..m, of_keys, 1.0);
    rotate::<L>(&mut work.values, (memory, head.memory(1)), 0..m, None, 1.0);
    work.keys_across.set_transposed::<L>(&work.keys, m, head_dim);
}
