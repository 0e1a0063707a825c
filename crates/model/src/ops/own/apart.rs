//! The parts of a block by themselves, for blocks that are put together otherwise: with biases, or with
//! norms after the sums.

use burn_flex::FlexTensor;

use super::autodiff::{Above, Gradients, Operation};
use super::buffers::{Buffer, recycle};
use super::elements::{dims, elements, elements_mut};
use super::{attention, rms_norm, swiglu};
use crate::ops::{AttentionOptions, CrossOptions};

/// Attention alone, of `[q | k | v]`; keeps its input and what makes its weights again. See
/// [`Kernels::attend`](crate::ops::Kernels::attend).
impl Operation<1> for AttentionOptions {
    type Kept = (FlexTensor, Buffer);

    fn forward(&self, [qkv]: &[FlexTensor; 1], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let (mixed, statistics) = attention::alone(elements(qkv), self.heads(), keep);
        let [n, columns] = dims(qkv);
        (mixed.into_tensor([n, columns / 3]), keep.then(|| (qkv.clone(), statistics)))
    }

    fn backward(&self, (qkv, statistics): Self::Kept, (gradient, _): Above<1>) -> Gradients<1> {
        let change = elements(&gradient);
        let by = attention::alone_back(elements(&qkv), self.heads(), &statistics, change);
        let shape = dims(&qkv);
        [gradient, qkv].into_iter().for_each(recycle);
        [Some(by.into_tensor(shape))]
    }
}

/// Attention to a memory, of queries and `[k | v]`; keeps its inputs and what makes its weights again.
/// See [`Kernels::cross_attend`](crate::ops::Kernels::cross_attend).
impl Operation<2> for CrossOptions {
    type Kept = ([FlexTensor; 2], Buffer);

    fn forward(&self, inputs: &[FlexTensor; 2], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let [queries, memory] = inputs.each_ref().map(elements);
        let shape = dims(&inputs[0]);
        let (mixed, statistics) = attention::cross(queries, memory, self.heads(shape[1]), keep);
        (mixed.into_tensor(shape), keep.then(|| (inputs.clone(), statistics)))
    }

    fn backward(&self, (inputs, statistics): Self::Kept, (gradient, _): Above<2>) -> Gradients<2> {
        let [queries, memory] = inputs.each_ref().map(elements);
        let ([of_queries, of_memory], change) = (inputs.each_ref().map(dims), elements(&gradient));
        let heads = self.heads(of_queries[1]);
        let [by_queries, by_memory] =
            attention::cross_back(queries, memory, heads, &statistics, change);
        inputs.into_iter().chain([gradient]).for_each(recycle);
        [by_queries.into_tensor(of_queries), by_memory.into_tensor(of_memory)].map(Some)
    }
}

/// RMSNorm alone, of x and γ; keeps its inputs and 1 / rms of each row. See
/// [`Kernels::rms_norm`](crate::ops::Kernels::rms_norm).
#[derive(Clone, Copy, Debug)]
pub struct RmsNorm {
    pub epsilon: f32,
}

impl Operation<2> for RmsNorm {
    type Kept = ([FlexTensor; 2], Buffer);

    fn forward(&self, inputs: &[FlexTensor; 2], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let [x, gamma] = inputs.each_ref().map(elements);
        let (mut output, mut inverses) = (Buffer::new(x.len()), Buffer::new(x.len() / gamma.len()));
        rms_norm::forward(x, gamma, self.epsilon, &mut output, &mut inverses);
        (output.into_tensor(dims(&inputs[0])), keep.then(|| (inputs.clone(), inverses)))
    }

    fn backward(
        &self,
        (inputs, inverses): Self::Kept,
        (mut gradient, _): Above<2>,
    ) -> Gradients<2> {
        let ([x, gamma], [n, d]) = (inputs.each_ref().map(elements), dims(&inputs[0]));
        let (mut by_x, mut by_gamma) = (Buffer::zeros(n * d), Buffer::zeros(d));
        let change = elements_mut(&mut gradient);
        rms_norm::backward(change, x, gamma, &inverses, &mut by_gamma, &mut by_x);
        inputs.into_iter().chain([gradient]).for_each(recycle);
        [by_x.into_tensor([n, d]), by_gamma.into_tensor([d])].map(Some)
    }
}

/// SwiGLU alone, of `[gate | up]`, which it keeps. See
/// [`Kernels::swi_glu`](crate::ops::Kernels::swi_glu).
#[derive(Clone, Copy, Debug)]
pub struct SwiGlu;

impl Operation<1> for SwiGlu {
    type Kept = FlexTensor;

    fn forward(&self, [gate_up]: &[FlexTensor; 1], keep: bool) -> (FlexTensor, Option<FlexTensor>) {
        let [n, columns] = dims(gate_up);
        let mut output = Buffer::new(n * columns / 2);
        swiglu::forward(elements(gate_up), columns / 2, &mut output);
        (output.into_tensor([n, columns / 2]), keep.then(|| gate_up.clone()))
    }

    fn backward(&self, gate_up: FlexTensor, (mut gradient, _): Above<1>) -> Gradients<1> {
        let [n, columns] = dims(&gate_up);
        let mut by = Buffer::new(n * columns);
        let change = elements_mut(&mut gradient);
        swiglu::backward(elements(&gate_up), columns / 2, &mut by, change);
        [gradient, gate_up].into_iter().for_each(recycle);
        [Some(by.into_tensor([n, columns]))]
    }
}
