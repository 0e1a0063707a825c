//! Operations outside autodiff: the losses of rows, the nearest codes, and the update of parameters.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, Flex, backend_extension};
use burn::tensor::Tensor;
use burn_flex::FlexTensor;

use super::HeadLoss;
use super::buffers::{Buffer, contiguous, dims, elements, elements_mut, tensor};
use super::lanes::{LANES, Lanes};
use super::matmul::{Start, Target, multiply};
use super::panels::{Panels, View};
use super::rows::dot;
use super::vectors::vectorised;
use crate::ops::{HeadWeights, RowLosses};

/// See [`Kernels::head_nll`](crate::ops::Kernels::head_nll).
pub fn head_nll(head: HeadLoss, x_sd: Tensor<2>, weights: HeadWeights) -> RowLosses {
    let [x, weight] = [x_sd, weights.weight_dv].map(|x| x.without_autodiff().into_dispatch());
    let gamma = weights.gamma_d.without_autodiff().into_dispatch();
    let data =
        Tensor::<2>::from_dispatch(Dispatch::rows_of_head(head, x, gamma, weight)).into_data();
    let rows = data.as_slice::<f32>().expect("the own operations compute in f32").as_chunks().0;
    RowLosses {
        nats: rows.iter().map(|&[large, small, _]| sum_of([large, small])).collect(),
        likeliest: rows.iter().map(|&[_, _, id]| id as u32).collect(),
    }
}

/// See [`nearest`](crate::ops::nearest()).
pub fn nearest(latents_nc: &Tensor<2>, codes_vc: &Tensor<2>) -> Vec<u32> {
    let [latents, codes] =
        [latents_nc, codes_vc].map(|x| x.clone().without_autodiff().into_dispatch());
    let ids = Tensor::<1>::from_dispatch(Dispatch::ids_of_nearest(latents, codes)).into_data();
    ids.iter::<f32>().map(|id| id as u32).collect()
}

/// Σ x².
pub fn sum_of_squares(x: Tensor<1>) -> f64 {
    let data = Tensor::<1>::from_dispatch(Dispatch::square_sum_of(x.into_dispatch())).into_data();
    let parts = data.as_slice::<f32>().expect("the own operations compute in f32");
    sum_of([parts[0], parts[1]])
}

/// See [`adamw`](crate::ops::adamw).
pub fn adamw(
    value: Tensor<1>,
    gradient: Tensor<1>,
    moments: [Tensor<1>; 2],
    step: AdamWStep,
) -> (Tensor<1>, [Tensor<1>; 2]) {
    let (value, gradient) = (value.into_dispatch(), gradient.into_dispatch());
    let [first, second] = moments.map(Tensor::into_dispatch);
    let (value, first, second) = Dispatch::adamw_step(value, gradient, first, second, step);
    (Tensor::from_dispatch(value), [first, second].map(Tensor::from_dispatch))
}

/// A number as the nearest `f32` and the remainder, since a tensor holds `f32`.
fn parts(x: f64) -> [f32; 2] {
    [x as f32, (x - f64::from(x as f32)) as f32]
}

/// The number of its parts.
fn sum_of([large, small]: [f32; 2]) -> f64 {
    f64::from(large) + f64::from(small)
}

/// Operations outside autodiff.
#[backend_extension(Flex)]
trait Detached: Backend {
    /// The two parts of each row's loss and its likeliest column, `[s, 3]`.
    fn rows_of_head(
        head: HeadLoss,
        x_sd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        weight_dv: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// The number of the nearest code of each latent, `[n]`.
    fn ids_of_nearest(
        latents_nc: FloatTensor<Self>,
        codes_vc: FloatTensor<Self>,
    ) -> FloatTensor<Self>;

    /// The two parts of Σ x², `[2]`.
    fn square_sum_of(x: FloatTensor<Self>) -> FloatTensor<Self>;

    /// The value and both moments after a step; see [`AdamWStep`].
    fn adamw_step(
        value: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        step: AdamWStep,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

impl Detached for Flex {
    fn rows_of_head(
        head: HeadLoss,
        x_sd: FlexTensor,
        gamma_d: FlexTensor,
        weight_dv: FlexTensor,
    ) -> FlexTensor {
        let found = head.rows_losses([x_sd, gamma_d, weight_dv]);
        let rows = found.nats.iter().zip(&found.likeliest).flat_map(|(&nats, &id)| {
            let [large, small] = parts(nats);
            [large, small, id as f32]
        });
        tensor(rows.collect(), [found.nats.len(), 3])
    }

    fn ids_of_nearest(latents_nc: FlexTensor, codes_vc: FlexTensor) -> FlexTensor {
        let [latents, codes] = [latents_nc, codes_vc].map(contiguous);
        let ids = nearest_codes(elements(&latents), elements(&codes), dims(&codes)[1]);
        let n = ids.len();
        tensor(ids.into_iter().map(|id| id as f32).collect(), [n])
    }

    fn square_sum_of(x: FlexTensor) -> FlexTensor {
        let total = square_sum(elements(&contiguous(x)));
        tensor(parts(total).into(), [2])
    }

    fn adamw_step(
        value: FlexTensor,
        gradient: FlexTensor,
        first: FlexTensor,
        second: FlexTensor,
        step: AdamWStep,
    ) -> (FlexTensor, FlexTensor, FlexTensor) {
        let [value, mut gradient, mut first, mut second] =
            [value, gradient, first, second].map(contiguous);
        let moments = (elements_mut(&mut first), elements_mut(&mut second));
        step_all(elements(&value), elements_mut(&mut gradient), moments.0, moments.1, step);
        // The model holds the old value until all parameters are updated, so its memory cannot be reused here.
        (gradient, first, second)
    }
}

// The nearest code of each latent, a block of codes by a chunk of latents at a time. No matrix of
// distances exists: a block of products is looked through while it is in the cache.

/// Latents of a chunk.
const CHUNK: usize = 512;

/// Codes of a block.
const BLOCK: usize = 128;

/// The best code so far of each latent of a chunk.
struct Best {
    /// latent · code − |code|² / 2.
    value: Vec<f32>,
    id: Vec<u32>,
}

/// argmax over codes `[v, c]` of latent · code − |code|² / 2 for each latent `[n, c]`, the first of equals.
fn nearest_codes(latents: &[f32], codes: &[f32], c: usize) -> Vec<u32> {
    let square = |code: &[f32]| code.iter().fold(0.0, |sum, x| sum + x * x);
    let halves: Vec<f32> = codes.chunks_exact(c).map(|code| square(code) / 2.0).collect();
    let mut panels = Panels::default();
    let mut products = Buffer::new(BLOCK * CHUNK);
    let mut ids = Vec::with_capacity(latents.len() / c);
    for latents in latents.chunks(CHUNK * c) {
        let n = latents.len() / c;
        let stride = n.next_multiple_of(LANES);
        // Of one channel the latents are the row that the transposed matrix has.
        let columns =
            if c == 1 { View::new(latents, n) } else { View::new(latents, c).transposed() };
        panels.pack(columns, c, n);
        let mut best = Best { value: vec![f32::MIN; stride], id: vec![0; stride] };
        for (block, halves) in halves.chunks(BLOCK).enumerate() {
            let codes = View::new(codes, c).skip_rows(block * BLOCK);
            let products = &mut products[..halves.len() * stride];
            multiply(Target::new(products, stride), halves.len(), codes, &panels, Start::Zero);
            take_block(products, (block * BLOCK) as u32, halves, &mut best);
        }
        ids.extend(&best.id[..n]);
    }
    ids
}

vectorised! {
    /// Looks through the products of a block of codes, rows of one latent a column.
    fn take_block(products: &[f32], first: u32, halves: &[f32], best: &mut Best) {
        let stride = best.value.len();
        for (at, so_far) in best.value.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
            let at = at * LANES;
            let (before, mut largest) = (*so_far, L::load(so_far));
            for (row, &half) in products.chunks_exact(stride).zip(halves) {
                let value = L::read(&row[at..at + LANES]).sub(L::splat(half));
                largest = value.max(largest);
            }
            largest.store(so_far);
            for (lane, (before, now)) in before.iter().zip(so_far.iter()).enumerate() {
                if now > before {
                    best.id[at + lane] = first + place(&products[at + lane..], stride, halves, *now);
                }
            }
        }
    }
}

/// The first code of a block whose value is this one.
fn place(products: &[f32], stride: usize, halves: &[f32], value: f32) -> u32 {
    let mut values = products.iter().step_by(stride).zip(halves).map(|(x, half)| x - half);
    values.position(|x| x == value).expect("it was met") as u32
}

// AdamW in one pass over a tensor, in place.

/// The update of every element by AdamW, given its gradient g:
///
/// m ← β₁ m + (1 − β₁) c g, v ← β₂ v + (1 − β₂) (c g)²,
/// p ← p · keep − rate · m / (√v · scale + ε).
#[derive(Debug, Clone, Copy)]
pub struct AdamWStep {
    pub beta_1: f32,
    pub beta_2: f32,
    pub epsilon: f32,
    /// c, by which gradients are scaled down.
    pub clip: f32,
    /// 1 − lr · weight decay.
    pub keep: f32,
    /// lr / (1 − β₁ᵗ).
    pub rate: f32,
    /// 1 / √(1 − β₂ᵗ).
    pub scale: f32,
}

vectorised! {
    /// One step of all elements, the values after it in place of the gradient; the slices are of one length.
    fn step_all(
        value: &[f32],
        gradient: &mut [f32],
        first: &mut [f32],
        second: &mut [f32],
        step: AdamWStep,
    ) {
        let state = first.chunks_mut(LANES).zip(second.chunks_mut(LANES));
        let elements = value.chunks(LANES).zip(gradient.chunks_mut(LANES));
        for ((value, gradient), (first, second)) in elements.zip(state) {
            let operands = [L::read(value), L::read(gradient), L::read(first), L::read(second)];
            let [after, m, v] = elements_after(operands, step);
            after.write(gradient);
            m.write(first);
            v.write(second);
        }
    }
}

/// Value and moments after the step.
#[inline(always)]
fn elements_after<L: Lanes>([p, g, m, v]: [L; 4], step: AdamWStep) -> [L; 3] {
    let g = g.mul(L::splat(step.clip));
    let m = m.mul_add(L::splat(step.beta_1), g.mul(L::splat(1.0 - step.beta_1)));
    let v = v.mul_add(L::splat(step.beta_2), g.mul(g).mul(L::splat(1.0 - step.beta_2)));
    let spread = v.sqrt().mul_add(L::splat(step.scale), L::splat(step.epsilon));
    let move_by = m.div(spread).mul(L::splat(step.rate));
    [p.mul(L::splat(step.keep)).sub(move_by), m, v]
}

/// Elements summed in `f32` before the total passes to `f64`.
const SUMMED: usize = 4096;

vectorised! {
    /// Σ x².
    fn square_sum(x: &[f32]) -> f64 {
        let mut total = 0.0;
        for block in x.chunks(SUMMED) {
            total += f64::from(dot::<L>(block, block));
        }
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_equals_is_taken_in_every_block_and_lane() {
        // Codes 1, 2, …, then the same again; latents between them.
        let n_codes = 3 * BLOCK + 5;
        let codes: Vec<f32> = (0..2 * n_codes).map(|i| (i % n_codes) as f32).collect();
        let latents: Vec<f32> = (0..CHUNK + 37).map(|i| (i % n_codes) as f32 + 0.25).collect();
        let ids = nearest_codes(&latents, &codes, 1);
        let expected: Vec<u32> = (0..CHUNK + 37).map(|i| (i % n_codes) as u32).collect();
        assert_eq!(ids, expected);
    }

    #[test]
    fn a_latent_that_is_no_number_takes_the_first_code() {
        assert_eq!(nearest_codes(&[f32::NAN, 2.0], &[1.0, 2.0, 3.0], 1), [0, 1]);
    }
}
