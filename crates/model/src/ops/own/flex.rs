//! The parts of the model, and what a step does to parameters, as operations on flex's tensors.

use std::sync::Arc;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Flex, backend_extension};
use burn_flex::FlexTensor;

use super::attention::{CrossHeads, Heads, half};
use super::autodiff::{Above, Gradients, Operation};
use super::buffers::{Buffer, recycle};
use super::elements::{contiguous, dims, elements, elements_mut, tensor};
use super::head::Head;
use super::{AdamWStep, adamw, convolution, feed_forward, nearest, rows};
use crate::ops::{Activation, AttentionOptions, Convolution, CrossOptions};

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

/// The attention half of a block, of x, γ, W_qkv and W_output; see
/// [`Kernels::attention`](crate::ops::Kernels::attention).
impl Operation<4> for AttentionOptions {
    type Kept = ([FlexTensor; 4], half::Intermediates);

    fn forward(&self, inputs: &[FlexTensor; 4], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let [x, gamma, qkv, output] = inputs.each_ref().map(elements);
        let weights = half::Weights { gamma, qkv, output, epsilon: self.epsilon };
        let (y, kept) = half::forward(x, weights, self.heads(), keep);
        (y.into_tensor(dims(&inputs[0])), kept.map(|kept| (inputs.clone(), kept)))
    }

    fn backward(&self, (inputs, kept): Self::Kept, (mut gradient, _): Above<4>) -> Gradients<4> {
        let [x, gamma, qkv, output] = inputs.each_ref().map(elements);
        let (d, change) = (gamma.len(), elements_mut(&mut gradient));
        let weights = half::Weights { gamma, qkv, output, epsilon: self.epsilon };
        let [gamma, qkv, output] = half::backward(change, x, weights, self.heads(), kept);
        inputs.into_iter().for_each(recycle);
        let qkv = qkv.into_tensor([d, 3 * d]);
        [gradient, gamma.into_tensor([d]), qkv, output.into_tensor([d, d])].map(Some)
    }
}

/// The feed-forward half of a block, of x, γ, W_up and W_down; see
/// [`Kernels::feed_forward`](crate::ops::Kernels::feed_forward).
#[derive(Clone, Copy, Debug)]
pub struct FeedForward {
    pub activation: Activation,
    pub epsilon: f32,
}

impl FeedForward {
    fn weights<'a>(&self, [_, gamma, up, down]: [&'a [f32]; 4]) -> feed_forward::Weights<'a> {
        let &Self { activation, epsilon } = self;
        feed_forward::Weights { gamma, up, down, activation, epsilon }
    }
}

impl Operation<4> for FeedForward {
    type Kept = ([FlexTensor; 4], feed_forward::Intermediates);

    fn forward(&self, inputs: &[FlexTensor; 4], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let operands = inputs.each_ref().map(elements);
        let (y, kept) = feed_forward::forward(operands[0], self.weights(operands), keep);
        (y.into_tensor(dims(&inputs[0])), kept.map(|kept| (inputs.clone(), kept)))
    }

    fn backward(&self, (inputs, kept): Self::Kept, (mut gradient, _): Above<4>) -> Gradients<4> {
        let (operands, change) = (inputs.each_ref().map(elements), elements_mut(&mut gradient));
        let by = feed_forward::backward(change, operands[0], self.weights(operands), kept);
        let ([gamma, up, down], of_up, of_down) = (by, dims(&inputs[2]), dims(&inputs[3]));
        inputs.into_iter().for_each(recycle);
        let gamma = gamma.into_tensor([of_up[0]]);
        [gradient, gamma, up.into_tensor(of_up), down.into_tensor(of_down)].map(Some)
    }
}

/// The head's loss, of x, γ and W; keeps the gradients, which are made on the way forward. See
/// [`Kernels::head_loss`](crate::ops::Kernels::head_loss).
#[derive(Clone, Debug)]
pub struct HeadLoss {
    pub targets: Arc<[u32]>,
    pub epsilon: f32,
}

impl HeadLoss {
    fn head<'a>(&'a self, inputs: &'a [FlexTensor; 3]) -> Head<'a> {
        let [x, gamma, weight] = inputs.each_ref().map(elements);
        Head { x, gamma, weight, epsilon: self.epsilon, targets: &self.targets }
    }
}

/// Mean cross-entropy from the rows' losses, in nats.
fn mean(losses: &[f64]) -> FlexTensor {
    tensor(vec![(losses.iter().sum::<f64>() / losses.len() as f64) as f32], [1])
}

impl Operation<3> for HeadLoss {
    type Kept = [Buffer; 3];

    fn forward(&self, inputs: &[FlexTensor; 3], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let head = self.head(inputs);
        if !keep {
            return (mean(&head.losses()), None);
        }
        let (losses, gradients) = head.losses_and_gradients();
        (mean(&losses), Some(gradients))
    }

    fn backward(&self, by: Self::Kept, (gradient, _): Above<3>) -> Gradients<3> {
        let above = elements(&gradient)[0];
        let [x, gamma, weight] = by.map(|by| scaled(by, above));
        let d = gamma.len();
        let (of_x, of_weight) = ([x.len() / d, d], [d, weight.len() / d]);
        [x.into_tensor(of_x), gamma.into_tensor([d]), weight.into_tensor(of_weight)].map(Some)
    }
}

/// Multiplies a gradient by the one that comes from above, which is 1 for the loss itself.
fn scaled(mut gradient: Buffer, by: f32) -> Buffer {
    if by != 1.0 {
        gradient.iter_mut().for_each(|x| *x *= by);
    }
    gradient
}

/// A convolution, of x, W and b; see [`Kernels::convolve`](crate::ops::Kernels::convolve).
impl Operation<3> for Convolution {
    type Kept = [FlexTensor; 3];

    fn forward(&self, inputs: &[FlexTensor; 3], keep: bool) -> (FlexTensor, Option<Self::Kept>) {
        let [x, weight, bias] = inputs.each_ref().map(elements);
        let y = convolution::forward(*self, x, convolution::Weights { weight, bias });
        let shape = [self.rows_out(dims(&inputs[0])[0]), bias.len()];
        (y.into_tensor(shape), keep.then(|| inputs.clone()))
    }

    fn backward(&self, inputs: Self::Kept, (gradient, [wants_x, ..]): Above<3>) -> Gradients<3> {
        let [x, weight, bias] = inputs.each_ref().map(elements);
        let (weights, change) = (convolution::Weights { weight, bias }, elements(&gradient));
        let by = convolution::backward(*self, change, x, weights, wants_x);
        let (of_x, of_weight) = (dims(&inputs[0]), dims(&inputs[1]));
        inputs.into_iter().chain([gradient]).for_each(recycle);
        let (weight, bias) =
            (by.weight.into_tensor(of_weight), by.bias.into_tensor([of_weight[1]]));
        [by.x.map(|x| x.into_tensor(of_x)), Some(weight), Some(bias)]
    }
}

/// Picking rows; keeps the shape. See [`Kernels::select_rows`](crate::ops::Kernels::select_rows).
#[derive(Clone, Debug)]
pub struct SelectRows(pub Arc<[u32]>);

impl Operation<1> for SelectRows {
    type Kept = [usize; 2];

    fn forward(&self, [x]: &[FlexTensor; 1], _: bool) -> (FlexTensor, Option<Self::Kept>) {
        let [m, d] = dims(x);
        let picked = rows::forward(elements(x), &self.0, d);
        (picked.into_tensor([self.0.len(), d]), Some([m, d]))
    }

    fn backward(&self, [m, d]: Self::Kept, (gradient, _): Above<1>) -> Gradients<1> {
        let by_x = rows::backward(elements(&gradient), &self.0, m, d);
        recycle(gradient);
        [Some(by_x.into_tensor([m, d]))]
    }
}

/// Operations outside autodiff.
#[backend_extension(Flex)]
pub trait OwnUpdates: Backend {
    /// The rows' losses, each as a large and a small part, since a tensor holds `f32`: `[s, 2]`;
    /// see [`Kernels::head_nll`](crate::ops::Kernels::head_nll).
    fn own_head_nll(
        head: HeadLoss,
        x_sd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        weight_dv: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// The number of the nearest code of each latent, `[n]`; see [`nearest`](crate::ops::nearest()).
    fn own_nearest(latents_nc: FloatTensor<Self>, codes_vc: FloatTensor<Self>)
    -> FloatTensor<Self>;

    /// Σ x², as a large and a small part: `[2]`.
    fn own_sum_of_squares(x: FloatTensor<Self>) -> FloatTensor<Self>;

    /// The value and both moments after a step; see [`AdamWStep`].
    fn own_adamw(
        value: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        step: AdamWStep,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

/// Numbers, each as the nearest `f32` and what is left.
fn parts(numbers: &[f64]) -> Vec<f32> {
    let parts = |&x: &f64| [x as f32, (x - f64::from(x as f32)) as f32];
    numbers.iter().flat_map(parts).collect()
}

impl OwnUpdates for Flex {
    fn own_head_nll(
        head: HeadLoss,
        x_sd: FlexTensor,
        gamma_d: FlexTensor,
        weight_dv: FlexTensor,
    ) -> FlexTensor {
        let losses = head.head(&[x_sd, gamma_d, weight_dv].map(contiguous)).losses();
        tensor(parts(&losses), [losses.len(), 2])
    }

    fn own_nearest(latents_nc: FlexTensor, codes_vc: FlexTensor) -> FlexTensor {
        let [latents, codes] = [latents_nc, codes_vc].map(contiguous);
        let ids = nearest::nearest(elements(&latents), elements(&codes), dims(&codes)[1]);
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
