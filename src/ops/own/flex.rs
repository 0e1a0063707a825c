//! The own operations on flex's tensors, without gradients.

use std::sync::Arc;

use burn::backend::Flex;
use burn_flex::FlexTensor;

use super::attention::{CrossHeads, Heads, half};
use super::buffers::{Buffer, recycle};
use super::elements::{contiguous, dims, elements, elements_mut, tensor};
use super::head::Head;
use super::{AdamWStep, OwnOps, OwnUpdates, adamw, convolution, feed_forward, nearest, rows};
use crate::ops::{Activation, AttentionOptions, Convolution, CrossOptions};

/// Mean cross-entropy from the rows' losses, in nats.
pub fn mean(losses: &[f64]) -> FlexTensor {
    tensor(vec![(losses.iter().sum::<f64>() / losses.len() as f64) as f32], [1])
}

/// Numbers, each as the nearest `f32` and what is left.
fn parts(numbers: &[f64]) -> Vec<f32> {
    let parts = |&x: &f64| [x as f32, (x - f64::from(x as f32)) as f32];
    numbers.iter().flat_map(parts).collect()
}

impl AttentionOptions {
    /// The heads that they speak of.
    pub fn heads(&self) -> Heads<'_> {
        Heads { layout: &self.layout, rope: &self.rope, n_head: self.n_head, first_row: 0 }
    }
}

impl CrossOptions {
    /// The heads that they speak of, of `d` columns.
    pub fn heads(&self, d: usize) -> CrossHeads<'_> {
        let ropes = self.ropes.as_ref().map(|ropes| ropes.each_ref().map(|rope| &**rope));
        let Self { n_head, layout, .. } = self;
        CrossHeads { layout, n_head: *n_head, head_dim: d / n_head, ropes }
    }
}

/// The tensors of attention, as slices.
pub fn attention_weights<'a>(
    [gamma, qkv, output]: [&'a FlexTensor; 3],
    epsilon: f32,
) -> half::Weights<'a> {
    let [gamma, qkv, output] = [gamma, qkv, output].map(elements);
    half::Weights { gamma, qkv, output, epsilon }
}

/// The tensors of the feed-forward half, as slices.
pub fn feed_forward_weights<'a>(
    [gamma, up, down]: [&'a FlexTensor; 3],
    activation: Activation,
    epsilon: f32,
) -> feed_forward::Weights<'a> {
    let [gamma, up, down] = [gamma, up, down].map(elements);
    feed_forward::Weights { gamma, up, down, activation, epsilon }
}

/// The tensors of a convolution, as slices.
pub fn convolution_weights<'a>([weight, bias]: [&'a FlexTensor; 2]) -> convolution::Weights<'a> {
    let [weight, bias] = [weight, bias].map(elements);
    convolution::Weights { weight, bias }
}

/// The tensors of the head, as slices.
pub fn head<'a>(
    [x, gamma, weight]: [&'a FlexTensor; 3],
    targets: &'a [u32],
    epsilon: f32,
) -> Head<'a> {
    let [x, gamma, weight] = [x, gamma, weight].map(elements);
    Head { x, gamma, weight, epsilon, targets }
}

impl OwnOps for Flex {
    fn own_attention(
        x_nd: FlexTensor,
        gamma_d: FlexTensor,
        qkv_d3d: FlexTensor,
        output_dd: FlexTensor,
        options: AttentionOptions,
    ) -> FlexTensor {
        let [x, gamma, qkv, output] = [x_nd, gamma_d, qkv_d3d, output_dd].map(contiguous);
        let weights = attention_weights([&gamma, &qkv, &output], options.epsilon);
        let (y, _) = half::forward(elements(&x), weights, options.heads(), false);
        let (n, d) = dims(&x);
        recycle(x);
        y.into_tensor([n, d])
    }

    fn own_feed_forward(
        x_nd: FlexTensor,
        gamma_d: FlexTensor,
        up_du: FlexTensor,
        down_fd: FlexTensor,
        activation: Activation,
        epsilon: f32,
    ) -> FlexTensor {
        let [x, gamma, up, down] = [x_nd, gamma_d, up_du, down_fd].map(contiguous);
        let weights = feed_forward_weights([&gamma, &up, &down], activation, epsilon);
        let (y, _) = feed_forward::forward(elements(&x), weights, false);
        let (n, d) = dims(&x);
        recycle(x);
        y.into_tensor([n, d])
    }

    fn own_head_loss(
        x_sd: FlexTensor,
        gamma_d: FlexTensor,
        weight_dv: FlexTensor,
        targets: Arc<[u32]>,
        epsilon: f32,
    ) -> FlexTensor {
        let [x, gamma, weight] = [x_sd, gamma_d, weight_dv].map(contiguous);
        mean(&head([&x, &gamma, &weight], &targets, epsilon).losses())
    }

    fn own_convolve(
        x_nc: FlexTensor,
        weight: FlexTensor,
        bias_o: FlexTensor,
        convolution: Convolution,
    ) -> FlexTensor {
        let [x, weight, bias] = [x_nc, weight, bias_o].map(contiguous);
        let weights = convolution_weights([&weight, &bias]);
        let y = convolution::forward(convolution, elements(&x), weights);
        let shape = [convolution.rows_out(dims(&x).0), dims(&weight).1];
        recycle(x);
        y.into_tensor(shape)
    }

    fn own_select_rows(x_md: FlexTensor, rows: Arc<[u32]>) -> FlexTensor {
        let x = contiguous(x_md);
        let d = dims(&x).1;
        let picked = rows::forward(elements(&x), &rows, d).into_tensor([rows.len(), d]);
        recycle(x);
        picked
    }
}

impl OwnUpdates for Flex {
    fn own_head_nll(
        x_sd: FlexTensor,
        gamma_d: FlexTensor,
        weight_dv: FlexTensor,
        targets: Arc<[u32]>,
        epsilon: f32,
    ) -> FlexTensor {
        let [x, gamma, weight] = [x_sd, gamma_d, weight_dv].map(contiguous);
        let losses = head([&x, &gamma, &weight], &targets, epsilon).losses();
        tensor(parts(&losses), [losses.len(), 2])
    }

    fn own_nearest(latents_nc: FlexTensor, codes_vc: FlexTensor) -> FlexTensor {
        let [latents, codes] = [latents_nc, codes_vc].map(contiguous);
        let ids = nearest::nearest(elements(&latents), elements(&codes), dims(&codes).1);
        let n = ids.len();
        tensor(ids.into_iter().map(|id| id as f32).collect(), [n])
    }

    fn own_sum_of_squares(x: FlexTensor) -> FlexTensor {
        let total = adamw::sum_of_squares(elements(&contiguous(x)));
        tensor(parts(&[total]), [2])
    }

    fn own_adamw(
        value: FlexTensor,
        gradient: FlexTensor,
        first: FlexTensor,
        second: FlexTensor,
        step: AdamWStep,
    ) -> (FlexTensor, FlexTensor, FlexTensor) {
        let [mut value, gradient, mut first, mut second] =
            [value, gradient, first, second].map(contiguous);
        let moments = (elements_mut(&mut first), elements_mut(&mut second));
        adamw::step(elements_mut(&mut value), elements(&gradient), moments.0, moments.1, step);
        recycle(gradient);
        (value, first, second)
    }
}

/// Multiplies a gradient by the one that comes from above, which is 1 for the loss itself.
pub fn scaled(mut gradient: Buffer, by: f32) -> Buffer {
    if by != 1.0 {
        gradient.iter_mut().for_each(|x| *x *= by);
    }
    gradient
}
