//! The own operations with gradients: what each keeps on the way forward, and its way back.

use std::sync::Arc;

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind, unary};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Flex};
use burn_flex::FlexTensor;

use super::attention::Heads;
use super::flex::{contiguous, dims, elements, elements_mut, mean, tensor};
use super::{OwnOps, attention, cross_entropy, rms_norm, rows, swiglu};
use crate::ops::{Rope, SequenceLayout};

impl<C: CheckpointStrategy> OwnOps for Autodiff<Flex, C> {
    fn own_rms_norm(
        x_nd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        epsilon: f32,
    ) -> FloatTensor<Self> {
        let ((x, x_node), (gamma, gamma_node)) = (x_nd.into_parts(), gamma_d.into_parts());
        let (x, gamma) = (contiguous(x), contiguous(gamma));
        let (n, d) = dims(&x);
        let (output, inverses) = rms_norm::forward(elements(&x), elements(&gamma), epsilon);
        let output = tensor(output, [n, d]);
        match RmsNorm.prepare::<C>([x_node, gamma_node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((x, gamma, inverses), output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }

    fn own_attention(
        qkv_n3d: FloatTensor<Self>,
        n_head: usize,
        layout: Arc<SequenceLayout>,
        rope: Arc<Rope>,
    ) -> FloatTensor<Self> {
        let (qkv, node) = qkv_n3d.into_parts();
        match Attention.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let (kept, output) = KeptAttention::forward(qkv, n_head, layout, rope);
                prep.finish(kept, output)
            }
            OpsKind::UnTracked(prep) => prep.finish(Flex::own_attention(qkv, n_head, layout, rope)),
        }
    }

    fn own_swiglu(gate_up_n2f: FloatTensor<Self>) -> FloatTensor<Self> {
        let (gate_up, node) = gate_up_n2f.into_parts();
        let gate_up = contiguous(gate_up);
        let output = Flex::own_swiglu(gate_up.clone());
        match SwiGlu.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(gate_up, output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }

    fn own_cross_entropy(logits_nv: FloatTensor<Self>, targets: Arc<[u32]>) -> FloatTensor<Self> {
        let (logits, node) = logits_nv.into_parts();
        let logits = contiguous(logits);
        let normalisers = cross_entropy::log_normalisers(elements(&logits), dims(&logits).1);
        let output = mean(&cross_entropy::losses(elements(&logits), &targets, &normalisers));
        match CrossEntropy.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((logits, targets, normalisers), output),
            OpsKind::UnTracked(prep) => prep.finish(output),
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

/// The way back of RMSNorm; keeps x, gamma and 1 / rms of each row.
#[derive(Debug)]
struct RmsNorm;

impl Backward<Flex, 2> for RmsNorm {
    type State = (FlexTensor, FlexTensor, Vec<f32>);

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (x, gamma, inverses) = ops.state;
        let mut gradient = contiguous(grads.consume::<Flex>(&ops.node));
        let by_gamma = rms_norm::backward(
            elements_mut(&mut gradient),
            elements(&x),
            elements(&gamma),
            &inverses,
        );
        let [x_node, gamma_node] = ops.parents;
        if let Some(node) = x_node {
            grads.register::<Flex>(node.id, gradient);
        }
        if let Some(node) = gamma_node {
            let d = by_gamma.len();
            grads.register::<Flex>(node.id, tensor(by_gamma, [d]));
        }
    }
}

/// The way back of attention.
#[derive(Debug)]
struct Attention;

/// What attention keeps: its input, the weights that are not masked, and what they belong to.
#[derive(Debug, Clone)]
struct KeptAttention {
    qkv: FlexTensor,
    weights: Vec<f32>,
    n_head: usize,
    layout: Arc<SequenceLayout>,
    rope: Arc<Rope>,
}

impl KeptAttention {
    fn forward(
        qkv: FlexTensor,
        n_head: usize,
        layout: Arc<SequenceLayout>,
        rope: Arc<Rope>,
    ) -> (Self, FlexTensor) {
        let qkv = contiguous(qkv);
        let (n, columns) = dims(&qkv);
        let heads = Heads { layout: &layout, rope: &rope, n_head };
        let (output, weights) = attention::forward(elements(&qkv), heads, true);
        (Self { qkv, weights, n_head, layout, rope }, tensor(output, [n, columns / 3]))
    }

    fn backward(mut self, gradient: FlexTensor) -> FlexTensor {
        let gradient = contiguous(gradient);
        let heads = Heads { layout: &self.layout, rope: &self.rope, n_head: self.n_head };
        let qkv = elements_mut(&mut self.qkv);
        attention::backward(qkv, heads, &self.weights, elements(&gradient));
        self.qkv
    }
}

impl Backward<Flex, 1> for Attention {
    type State = KeptAttention;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let kept = ops.state;
        unary::<Flex, _>(ops.parents, ops.node, grads, |gradient| kept.backward(gradient));
    }
}

/// The way back of SwiGLU; keeps `[gate | up]`.
#[derive(Debug)]
struct SwiGlu;

impl Backward<Flex, 1> for SwiGlu {
    type State = FlexTensor;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let mut gate_up = ops.state;
        unary::<Flex, _>(ops.parents, ops.node, grads, |gradient| {
            let gradient = contiguous(gradient);
            let f = dims(&gradient).1;
            swiglu::backward(elements_mut(&mut gate_up), elements(&gradient), f);
            gate_up
        });
    }
}

/// The way back of cross-entropy; keeps the logits, the targets and the rows' log-normalisers.
#[derive(Debug)]
struct CrossEntropy;

impl Backward<Flex, 1> for CrossEntropy {
    type State = (FlexTensor, Arc<[u32]>, Vec<f64>);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (mut logits, targets, normalisers) = ops.state;
        unary::<Flex, _>(ops.parents, ops.node, grads, |gradient| {
            let scale = elements(&contiguous(gradient))[0] / targets.len() as f32;
            cross_entropy::backward(elements_mut(&mut logits), &targets, &normalisers, scale);
            logits
        });
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
            tensor(rows::backward(elements(&contiguous(gradient)), &rows, m, d), [m, d])
        });
    }
}
