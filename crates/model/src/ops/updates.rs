//! What a step does to parameters, outside autodiff.

use burn::backend::Dispatch;
use burn::tensor::Tensor;

use super::own::{AdamWStep, OwnUpdates};
use super::parts::sums_of_parts;
use super::{Kernels, plain};

/// Σ x² over tensors of one device, outside autodiff. A device other than the processor's default is waited
/// for once, not once a tensor.
pub fn sum_of_squares(tensors: Vec<Tensor<1>>) -> f64 {
    let Some(first) = tensors.first() else { return 0.0 };
    if Kernels::for_device(&first.device()) == Kernels::Own {
        let of = |x: Tensor<1>| {
            let parts = Dispatch::own_sum_of_squares(x.into_dispatch());
            sums_of_parts(Tensor::<1>::from_dispatch(parts))[0]
        };
        return tensors.into_iter().map(of).sum();
    }
    let sums: Vec<Tensor<1>> = tensors.into_iter().map(|x| (x.clone() * x).sum()).collect();
    f64::from(Tensor::cat(sums, 0).sum().into_scalar::<f32>())
}

/// A parameter and both its moments after a step of AdamW, all of one length and outside autodiff.
pub fn adamw(
    value: Tensor<1>,
    gradient: Tensor<1>,
    [first, second]: [Tensor<1>; 2],
    step: AdamWStep,
) -> (Tensor<1>, [Tensor<1>; 2]) {
    if Kernels::for_device(&value.device()) != Kernels::Own {
        return plain::adamw(value, gradient, [first, second], step);
    }
    let (value, first, second) = Dispatch::own_adamw(
        value.into_dispatch(),
        gradient.into_dispatch(),
        first.into_dispatch(),
        second.into_dispatch(),
        step,
    );
    let [value, first, second] = [value, first, second].map(Tensor::from_dispatch);
    (value, [first, second])
}
