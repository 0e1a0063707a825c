//! The nearest code of each latent.
//!
//! Shapes: n latents, c channels, v codes.

use burn::backend::Dispatch;
use burn::tensor::Tensor;

use super::own::OwnUpdates;
use super::{Kernels, plain};

/// argmin over codes of |code|² − 2 latent · code for each latent, the first of equals.
///
/// # Panics
///
/// If latents and codes differ in their channels, there is no code, or there are more than 2²⁴.
pub fn nearest(latents_nc: &Tensor<2>, codes_vc: &Tensor<2>) -> Vec<u32> {
    let ([n, c], [v, channels]) = (latents_nc.dims(), codes_vc.dims());
    assert_eq!(c, channels, "nearest: latents of {c} channels, codes of {channels}");
    assert!((1..=MOST_CODES).contains(&v), "nearest: {v} codes");
    if n == 0 {
        return Vec::new();
    }
    if Kernels::for_device(&latents_nc.device()) != Kernels::Own {
        return plain::nearest(latents_nc, codes_vc);
    }
    let ids_n = Tensor::<1>::from_dispatch(Dispatch::own_nearest(
        latents_nc.clone().without_autodiff().into_dispatch(),
        codes_vc.clone().without_autodiff().into_dispatch(),
    ));
    let ids = ids_n.into_data();
    ids.iter::<f32>().map(|id| id as u32).collect()
}

/// As many as `f32` counts without a gap.
const MOST_CODES: usize = 1 << 24;
