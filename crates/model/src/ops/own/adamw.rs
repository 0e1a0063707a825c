//! AdamW in one pass over a tensor, in place.

use super::lanes::{LANES, Lanes, vectorised};

/// What a step of AdamW does to every element, given its gradient g:
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
    /// One step of all elements; the slices are of one length.
    pub fn step(
        value: &mut [f32],
        gradient: &[f32],
        first: &mut [f32],
        second: &mut [f32],
        step: AdamWStep,
    ) {
        let state = first.chunks_mut(LANES).zip(second.chunks_mut(LANES));
        let elements = value.chunks_mut(LANES).zip(gradient.chunks(LANES));
        for ((value, gradient), (first, second)) in elements.zip(state) {
            let operands = [L::read(value), L::read(gradient), L::read(first), L::read(second)];
            let [after, m, v] = elements_after(operands, step);
            after.write(value);
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
const BLOCK: usize = 4096;

vectorised! {
    /// Σ x².
    pub fn sum_of_squares(x: &[f32]) -> f64 {
        let mut total = 0.0;
        for block in x.chunks(BLOCK) {
            total += f64::from(super::maths::dot::<L>(block, block));
        }
        total
    }
}
