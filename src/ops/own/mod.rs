//! The own operations on the CPU device `flex`, and what autodiff needs to know of them.
//!
//! | file | what it holds |
//! | --- | --- |
//! | [`lanes`], [`x86`] | sixteen numbers at a time, on the vectors that the machine has |
//! | [`maths`], [`scratch`], [`left`], [`product`] | what the kernels share |
//! | [`matmul`] | products of large matrices |
//! | [`buffers`] | memory that goes from step to step |
//! | [`rms_norm`], [`swiglu`], [`gelu`], [`cross_entropy`], [`rows`] | kernel pairs on slices |
//! | [`attention`], [`feed_forward`], [`head`] | the parts of the model, composed of these |
//! | [`convolution`] | the layers of tokenizers |
//! | [`nearest`] | the codes of latents |
//! | [`adamw`] | the optimiser |
//! | [`elements`], [`flex`] | flex's tensors, and the operations on them |
//! | [`autodiff`] | the same with gradients |
//! | [`apart`] | attention, RMSNorm and SwiGLU without what usually stands around them |
//!
//! Every kernel runs on the calling thread and reduces in a fixed order: the same input gives the
//! same bits. The way back writes over what the way forward kept and over the gradient that it is
//! given, wherever nobody else holds it, so it allocates next to nothing.

use std::sync::Arc;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, backend_extension};

use super::{Activation, AttentionOptions, Convolution};

mod adamw;
mod apart;
pub(super) mod attention;
mod autodiff;
mod buffers;
mod convolution;
mod cross_entropy;
mod elements;
mod feed_forward;
mod flex;
mod gelu;
mod head;
mod lanes;
mod left;
mod maths;
mod matmul;
mod nearest;
mod product;
mod rms_norm;
mod rows;
mod scratch;
mod swiglu;
#[cfg(target_arch = "x86_64")]
pub(super) mod x86;

pub use adamw::AdamWStep;
pub use apart::OwnParts;

/// The operations of [`Kernels`](super::Kernels), on the tensors of a backend.
#[backend_extension(Flex, Autodiff)]
pub trait OwnOps: Backend {
    /// See [`Kernels::attention`](super::Kernels::attention).
    fn own_attention(
        x_nd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        qkv_d3d: FloatTensor<Self>,
        output_dd: FloatTensor<Self>,
        options: AttentionOptions,
    ) -> FloatTensor<Self>;

    /// See [`Kernels::feed_forward`](super::Kernels::feed_forward).
    fn own_feed_forward(
        x_nd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        up_du: FloatTensor<Self>,
        down_fd: FloatTensor<Self>,
        activation: Activation,
        epsilon: f32,
    ) -> FloatTensor<Self>;

    /// See [`Kernels::head_loss`](super::Kernels::head_loss).
    fn own_head_loss(
        x_sd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        weight_dv: FloatTensor<Self>,
        targets: Arc<[u32]>,
        epsilon: f32,
    ) -> FloatTensor<Self>;

    /// See [`Kernels::convolve`](super::Kernels::convolve).
    fn own_convolve(
        x_nc: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias_o: FloatTensor<Self>,
        convolution: Convolution,
    ) -> FloatTensor<Self>;

    /// See [`Kernels::select_rows`](super::Kernels::select_rows).
    fn own_select_rows(x_md: FloatTensor<Self>, rows: Arc<[u32]>) -> FloatTensor<Self>;
}

/// Operations outside autodiff.
#[backend_extension(Flex)]
pub trait OwnUpdates: Backend {
    /// The rows' losses, each as a large and a small part, since a tensor holds `f32`: `[s, 2]`;
    /// see [`Kernels::head_nll`](super::Kernels::head_nll).
    fn own_head_nll(
        x_sd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        weight_dv: FloatTensor<Self>,
        targets: Arc<[u32]>,
        epsilon: f32,
    ) -> FloatTensor<Self>;

    /// The number of the nearest code of each latent, `[n]`; see [`nearest`](super::nearest()).
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
