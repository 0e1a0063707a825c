//! The own operations with gradients: what each keeps on the way forward, and its way back.

use std::sync::Arc;

use burn::backend::autodiff::NodeId;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind, unary};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Flex};
use burn_flex::FlexTensor;

use super::attention::half;
use super::buffers::recycle;
use super::elements::{contiguous, dims, elements, elements_mut};
use super::flex::{
    attention_weights, convolution_weights, feed_forward_weights, head, mean, scaled,
};
use super::head::Gradients as HeadGradients;
use super::{OwnOps, convolution, feed_forward, rows};
use crate::ops::{Activation, AttentionOptions, Convolution};

impl<C: CheckpointStrategy> OwnOps for Autodiff<Flex, C> {
    fn own_attention(
        x_nd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        qkv_d3d: FloatTensor<Self>,
        output_dd: FloatTensor<Self>,
        options: AttentionOptions,
    ) -> FloatTensor<Self> {
        let inputs = [x_nd, gamma_d, qkv_d3d, output_dd].map(|input| input.into_parts());
        let (inputs, nodes) = split(inputs);
        match Attention.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prep) => {
                let [x, gamma, qkv, output] = inputs;
                prep.finish(Flex::own_attention(x, gamma, qkv, output, options))
            }
            OpsKind::Tracked(prep) => {
                let [x, gamma, qkv, output] = inputs.map(contiguous);
                let weights = attention_weights([&gamma, &qkv, &output], options.epsilon);
                let (y, kept) = half::forward(elements(&x), weights, options.heads(), true);
                let (n, d) = dims(&x);
                let kept = kept.expect("asked for");
                prep.finish(([x, gamma, qkv, output], options, kept), y.into_tensor([n, d]))
            }
        }
    }

    fn own_feed_forward(
        x_nd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        up_du: FloatTensor<Self>,
        down_fd: FloatTensor<Self>,
        activation: Activation,
        epsilon: f32,
    ) -> FloatTensor<Self> {
        let inputs = [x_nd, gamma_d, up_du, down_fd].map(|input| input.into_parts());
        let (inputs, nodes) = split(inputs);
        match FeedForward.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prep) => {
                let [x, gamma, up, down] = inputs;
                prep.finish(Flex::own_feed_forward(x, gamma, up, down, activation, epsilon))
            }
            OpsKind::Tracked(prep) => {
                let [x, gamma, up, down] = inputs.map(contiguous);
                let weights = feed_forward_weights([&gamma, &up, &down], activation, epsilon);
                let (y, kept) = feed_forward::forward(elements(&x), weights, true);
                let (n, d) = dims(&x);
                let kept = kept.expect("asked for");
                let state = ([x, gamma, up, down], activation, epsilon, kept);
                prep.finish(state, y.into_tensor([n, d]))
            }
        }
    }

    fn own_head_loss(
        x_sd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        weight_dv: FloatTensor<Self>,
        targets: Arc<[u32]>,
        epsilon: f32,
    ) -> FloatTensor<Self> {
        let inputs = [x_sd, gamma_d, weight_dv].map(|input| input.into_parts());
        let (inputs, nodes) = split(inputs);
        match HeadLoss.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prep) => {
                let [x, gamma, weight] = inputs;
                prep.finish(Flex::own_head_loss(x, gamma, weight, targets, epsilon))
            }
            OpsKind::Tracked(prep) => {
                let [x, gamma, weight] = inputs.map(contiguous);
                let head = head([&x, &gamma, &weight], &targets, epsilon);
                let (losses, gradients) = head.losses_and_gradients();
                let shapes = [dims(&x), dims(&weight)];
                recycle(x);
                prep.finish((shapes, gradients), mean(&losses))
            }
        }
    }

    fn own_convolve(
        x_nc: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias_o: FloatTensor<Self>,
        convolution: Convolution,
    ) -> FloatTensor<Self> {
        let inputs = [x_nc, weight, bias_o].map(|input| input.into_parts());
        let (inputs, nodes) = split(inputs);
        match Convolve.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::UnTracked(prep) => {
                let [x, weight, bias] = inputs;
                prep.finish(Flex::own_convolve(x, weight, bias, convolution))
            }
            OpsKind::Tracked(prep) => {
                let [x, weight, bias] = inputs.map(contiguous);
                let weights = convolution_weights([&weight, &bias]);
                let y = convolution::forward(convolution, elements(&x), weights);
                let shape = [convolution.rows_out(dims(&x).0), dims(&weight).1];
                prep.finish(([x, weight, bias], convolution), y.into_tensor(shape))
            }
        }
    }

    fn own_select_rows(x_md: FloatTensor<Self>, rows: Arc<[u32]>) -> FloatTensor<Self> {
        let (x, node) = x_md.into_parts();
        let shape = dims(&x);
        let output = Flex::own_select_rows(x, rows.clone());
        match SelectRows.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((shape, rows), output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }
}

/// Pairs into a pair.
pub(super) fn split<A, B, const N: usize>(pairs: [(A, B); N]) -> ([A; N], [B; N]) {
    let mut nodes = Vec::with_capacity(N);
    let tensors = pairs.map(|(tensor, node)| {
        nodes.push(node);
        tensor
    });
    (tensors, nodes.try_into().ok().expect("as many as there were"))
}

/// Hands a gradient to a node that wants it.
pub(super) fn register(grads: &mut Gradients, node: Option<NodeId>, gradient: FlexTensor) {
    match node {
        Some(node) => grads.register::<Flex>(node, gradient),
        None => recycle(gradient),
    }
}

/// The way back of the attention half of a block; keeps its inputs and what its kernels want.
#[derive(Debug)]
struct Attention;

impl Backward<Flex, 4> for Attention {
    type State = ([FlexTensor; 4], AttentionOptions, half::Intermediates);

    fn backward(self, ops: Ops<Self::State, 4>, grads: &mut Gradients, _: &mut Checkpointer) {
        let ([x, gamma, qkv, output], options, kept) = ops.state;
        let mut gradient = contiguous(grads.consume::<Flex>(&ops.node));
        let weights = attention_weights([&gamma, &qkv, &output], options.epsilon);
        let change = elements_mut(&mut gradient);
        let by = half::backward(change, elements(&x), weights, options.heads(), kept);
        let [x_node, gamma_node, qkv_node, output_node] =
            ops.parents.map(|parent| parent.map(|node| node.id));
        let d = dims(&x).1;
        recycle(x);
        register(grads, x_node, gradient);
        register(grads, gamma_node, by.gamma.into_tensor([d]));
        register(grads, qkv_node, by.qkv.into_tensor([d, 3 * d]));
        register(grads, output_node, by.output.into_tensor([d, d]));
    }
}

/// The way back of the feed-forward half of a block; keeps its inputs and what its kernels want.
#[derive(Debug)]
struct FeedForward;

impl Backward<Flex, 4> for FeedForward {
    type State = ([FlexTensor; 4], Activation, f32, feed_forward::Intermediates);

    fn backward(self, ops: Ops<Self::State, 4>, grads: &mut Gradients, _: &mut Checkpointer) {
        let ([x, gamma, up, down], activation, epsilon, kept) = ops.state;
        let mut gradient = contiguous(grads.consume::<Flex>(&ops.node));
        let weights = feed_forward_weights([&gamma, &up, &down], activation, epsilon);
        let change = elements_mut(&mut gradient);
        let by = feed_forward::backward(change, elements(&x), weights, kept);
        let [x_node, gamma_node, up_node, down_node] =
            ops.parents.map(|parent| parent.map(|node| node.id));
        let ((d, u), f) = (dims(&up), dims(&down).0);
        recycle(x);
        register(grads, x_node, gradient);
        register(grads, gamma_node, by.gamma.into_tensor([d]));
        register(grads, up_node, by.up.into_tensor([d, u]));
        register(grads, down_node, by.down.into_tensor([f, d]));
    }
}

/// The way back of the head; keeps the gradients, which were made on the way forward.
#[derive(Debug)]
struct HeadLoss;

impl Backward<Flex, 3> for HeadLoss {
    type State = ([(usize, usize); 2], HeadGradients);

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let ([(s, d), (_, v)], by) = ops.state;
        let above = elements(&contiguous(grads.consume::<Flex>(&ops.node)))[0];
        let [x_node, gamma_node, weight_node] =
            ops.parents.map(|parent| parent.map(|node| node.id));
        register(grads, x_node, scaled(by.x, above).into_tensor([s, d]));
        register(grads, gamma_node, scaled(by.gamma, above).into_tensor([d]));
        register(grads, weight_node, scaled(by.weight, above).into_tensor([d, v]));
    }
}

/// The way back of a convolution; keeps its inputs.
#[derive(Debug)]
struct Convolve;

impl Backward<Flex, 3> for Convolve {
    type State = ([FlexTensor; 3], Convolution);

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let ([x, weight, bias], convolution) = ops.state;
        let gradient = contiguous(grads.consume::<Flex>(&ops.node));
        let [x_node, weight_node, bias_node] = ops.parents.map(|parent| parent.map(|node| node.id));
        let (weights, wants_x) = (convolution_weights([&weight, &bias]), x_node.is_some());
        let change = elements(&gradient);
        let by = convolution::backward(convolution, change, elements(&x), weights, wants_x);
        let ((n, c), (rows, o)) = (dims(&x), dims(&weight));
        recycle(gradient);
        recycle(x);
        if let Some(by_x) = by.x {
            register(grads, x_node, by_x.into_tensor([n, c]));
        }
        register(grads, weight_node, by.weight.into_tensor([rows, o]));
        register(grads, bias_node, by.bias.into_tensor([o]));
    }
}

/// The way back of picking rows; keeps the shape and the rows.
#[derive(Debug)]
struct SelectRows;

impl Backward<Flex, 1> for SelectRows {
    type State = ((usize, usize), Arc<[u32]>);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let ((m, d), rows) = ops.state;
        unary::<Flex, _>(ops.parents, ops.node, grads, |gradient| {
            let gradient = contiguous(gradient);
            let by_x = rows::backward(elements(&gradient), &rows, m, d);
            recycle(gradient);
            by_x.into_tensor([m, d])
        });
    }
}
