//! The parts of a block by themselves, for blocks that are put together otherwise: with biases, or with
//! norms after the sums.

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind, unary};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Flex, backend_extension};
use burn_flex::FlexTensor;

use super::autodiff::{register, split};
use super::buffers::{Buffer, recycle};
use super::elements::{contiguous, dims, elements, elements_mut};
use super::{attention, rms_norm, swiglu};
use crate::ops::{AttentionOptions, CrossOptions};

/// Parts of a block, each by itself.
#[backend_extension(Flex, Autodiff)]
pub trait OwnParts: Backend {
    /// See [`Kernels::attend`](crate::ops::Kernels::attend).
    fn own_attend(qkv_n3d: FloatTensor<Self>, options: AttentionOptions) -> FloatTensor<Self>;

    /// See [`Kernels::cross_attend`](crate::ops::Kernels::cross_attend).
    fn own_cross_attend(
        queries_nd: FloatTensor<Self>,
        key_values_m2d: FloatTensor<Self>,
        options: CrossOptions,
    ) -> FloatTensor<Self>;

    /// See [`Kernels::rms_norm`](crate::ops::Kernels::rms_norm).
    fn own_rms_norm(
        x_nd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        epsilon: f32,
    ) -> FloatTensor<Self>;

    /// See [`Kernels::swi_glu`](crate::ops::Kernels::swi_glu).
    fn own_swi_glu(gate_up_n2f: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// The normalised rows, and 1 / rms of each.
fn normalised(x: &FlexTensor, gamma: &FlexTensor, epsilon: f32) -> (Buffer, Buffer) {
    let (n, d) = dims(x);
    let (mut output, mut inverses) = (Buffer::new(n * d), Buffer::new(n));
    rms_norm::forward(elements(x), elements(gamma), epsilon, &mut output, &mut inverses);
    (output, inverses)
}

/// silu(gate) up of each row.
fn activated(gate_up: &FlexTensor) -> FlexTensor {
    let (n, columns) = dims(gate_up);
    let mut output = Buffer::new(n * columns / 2);
    swiglu::forward(elements(gate_up), columns / 2, &mut output);
    output.into_tensor([n, columns / 2])
}

impl OwnParts for Flex {
    fn own_attend(qkv_n3d: FlexTensor, options: AttentionOptions) -> FlexTensor {
        let qkv = contiguous(qkv_n3d);
        let (mixed, _) = attention::alone(elements(&qkv), options.heads(), false);
        let (n, columns) = dims(&qkv);
        recycle(qkv);
        mixed.into_tensor([n, columns / 3])
    }

    fn own_cross_attend(
        queries_nd: FlexTensor,
        key_values_m2d: FlexTensor,
        options: CrossOptions,
    ) -> FlexTensor {
        let [queries, memory] = [queries_nd, key_values_m2d].map(contiguous);
        let (n, d) = dims(&queries);
        let heads = options.heads(d);
        let (mixed, _) = attention::cross(elements(&queries), elements(&memory), heads, false);
        recycle(queries);
        recycle(memory);
        mixed.into_tensor([n, d])
    }

    fn own_rms_norm(x_nd: FlexTensor, gamma_d: FlexTensor, epsilon: f32) -> FlexTensor {
        let [x, gamma] = [x_nd, gamma_d].map(contiguous);
        let ((n, d), (output, _)) = (dims(&x), normalised(&x, &gamma, epsilon));
        recycle(x);
        output.into_tensor([n, d])
    }

    fn own_swi_glu(gate_up_n2f: FlexTensor) -> FlexTensor {
        let gate_up = contiguous(gate_up_n2f);
        let output = activated(&gate_up);
        recycle(gate_up);
        output
    }
}

impl<C: CheckpointStrategy> OwnParts for Autodiff<Flex, C> {
    fn own_attend(qkv_n3d: FloatTensor<Self>, options: AttentionOptions) -> FloatTensor<Self> {
        let (qkv, node) = qkv_n3d.into_parts();
        match Attend.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::UnTracked(prep) => prep.finish(Flex::own_attend(qkv, options)),
            OpsKind::Tracked(prep) => {
                let qkv = contiguous(qkv);
                let (mixed, statistics) = attention::alone(elements(&qkv), options.heads(), true);
                let (n, columns) = dims(&qkv);
                prep.finish((qkv, options, statistics), mixed.into_tensor([n, columns / 3]))
            }
        }
    }

    fn own_cross_attend(
        queries_nd: FloatTensor<Self>,
        key_values_m2d: FloatTensor<Self>,
        options: CrossOptions,
    ) -> FloatTensor<Self> {
        let inputs = [queries_nd, key_values_m2d].map(|input| input.into_parts());
        let (inputs, nodes) = split(inputs);
        match CrossAttend.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prep) => {
                let [queries, memory] = inputs;
                prep.finish(Flex::own_cross_attend(queries, memory, options))
            }
            OpsKind::Tracked(prep) => {
                let [queries, memory] = inputs.map(contiguous);
                let (n, d) = dims(&queries);
                let (from, to) = (elements(&queries), elements(&memory));
                let (mixed, statistics) = attention::cross(from, to, options.heads(d), true);
                let state = ([queries, memory], options, statistics);
                prep.finish(state, mixed.into_tensor([n, d]))
            }
        }
    }

    fn own_rms_norm(
        x_nd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        epsilon: f32,
    ) -> FloatTensor<Self> {
        let (inputs, nodes) = split([x_nd, gamma_d].map(|input| input.into_parts()));
        match RmsNorm.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prep) => {
                let [x, gamma] = inputs;
                prep.finish(Flex::own_rms_norm(x, gamma, epsilon))
            }
            OpsKind::Tracked(prep) => {
                let [x, gamma] = inputs.map(contiguous);
                let ((n, d), (output, inverses)) = (dims(&x), normalised(&x, &gamma, epsilon));
                prep.finish(([x, gamma], inverses), output.into_tensor([n, d]))
            }
        }
    }

    fn own_swi_glu(gate_up_n2f: FloatTensor<Self>) -> FloatTensor<Self> {
        let (gate_up, node) = gate_up_n2f.into_parts();
        match SwiGlu.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::UnTracked(prep) => prep.finish(Flex::own_swi_glu(gate_up)),
            OpsKind::Tracked(prep) => {
                let gate_up = contiguous(gate_up);
                let output = activated(&gate_up);
                prep.finish(gate_up, output)
            }
        }
    }
}

/// The way back of attention alone; keeps its input and what makes its weights again.
#[derive(Debug)]
struct Attend;

impl Backward<Flex, 1> for Attend {
    type State = (FlexTensor, AttentionOptions, Buffer);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (qkv, options, statistics) = ops.state;
        unary::<Flex, _>(ops.parents, ops.node, grads, |gradient| {
            let gradient = contiguous(gradient);
            let change = elements(&gradient);
            let by = attention::alone_back(elements(&qkv), options.heads(), &statistics, change);
            let (n, columns) = dims(&qkv);
            recycle(gradient);
            recycle(qkv);
            by.into_tensor([n, columns])
        });
    }
}

/// The way back of attention to a memory; keeps its inputs and what makes its weights again.
#[derive(Debug)]
struct CrossAttend;

impl Backward<Flex, 2> for CrossAttend {
    type State = ([FlexTensor; 2], CrossOptions, Buffer);

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let ([queries, memory], options, statistics) = ops.state;
        let gradient = contiguous(grads.consume::<Flex>(&ops.node));
        let [queries_node, memory_node] = ops.parents.map(|parent| parent.map(|node| node.id));
        let ((n, d), (m, columns)) = (dims(&queries), dims(&memory));
        let (from, to) = (elements(&queries), elements(&memory));
        let change = elements(&gradient);
        let [by_queries, by_memory] =
            attention::cross_back(from, to, options.heads(d), &statistics, change);
        [gradient, queries, memory].into_iter().for_each(recycle);
        register(grads, queries_node, by_queries.into_tensor([n, d]));
        register(grads, memory_node, by_memory.into_tensor([m, columns]));
    }
}

/// The way back of RMSNorm alone; keeps its inputs and 1 / rms of each row.
#[derive(Debug)]
struct RmsNorm;

impl Backward<Flex, 2> for RmsNorm {
    type State = ([FlexTensor; 2], Buffer);

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let ([x, gamma], inverses) = ops.state;
        let mut gradient = contiguous(grads.consume::<Flex>(&ops.node));
        let [x_node, gamma_node] = ops.parents.map(|parent| parent.map(|node| node.id));
        let (n, d) = dims(&x);
        let (mut by_x, mut by_gamma) = (Buffer::zeros(n * d), Buffer::zeros(d));
        let change = elements_mut(&mut gradient);
        let (values, gain) = (elements(&x), elements(&gamma));
        rms_norm::backward(change, values, gain, &inverses, &mut by_gamma, &mut by_x);
        recycle(gradient);
        recycle(x);
        register(grads, x_node, by_x.into_tensor([n, d]));
        register(grads, gamma_node, by_gamma.into_tensor([d]));
    }
}

/// The way back of SwiGLU alone; keeps its input.
#[derive(Debug)]
struct SwiGlu;

impl Backward<Flex, 1> for SwiGlu {
    type State = FlexTensor;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let gate_up = ops.state;
        unary::<Flex, _>(ops.parents, ops.node, grads, |gradient| {
            let mut gradient = contiguous(gradient);
            let (n, columns) = dims(&gate_up);
            let mut by = Buffer::new(n * columns);
            let change = elements_mut(&mut gradient);
            swiglu::backward(elements(&gate_up), columns / 2, &mut by, change);
            recycle(gradient);
            recycle(gate_up);
            by.into_tensor([n, columns])
        });
    }
}
