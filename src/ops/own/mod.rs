//! The own operations on the CPU device `flex`, and what autodiff needs to know of them.
//!
//! | file | what it holds |
//! | --- | --- |
//! | [`lanes`], [`x86`] | sixteen numbers at a time, on the vectors that the machine has |
//! | [`maths`], [`product`] | what the kernels share |
//! | [`rms_norm`], [`attention`], [`swiglu`], [`cross_entropy`], [`rows`] | a kernel pair each, on slices |
//! | [`flex`] | the operations on flex's tensors |
//! | [`autodiff`] | the same with gradients |
//!
//! Every kernel runs on the calling thread and reduces in a fixed order: the same input gives the
//! same bits. The way back writes over what the way forward kept (attention's queries, keys and
//! values, the logits, gate and up) wherever nobody else holds it, so it allocates next to nothing.

use std::sync::Arc;

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, backend_extension};

use super::{Rope, SequenceLayout};

mod attention;
mod autodiff;
mod cross_entropy;
mod flex;
mod lanes;
mod maths;
mod product;
mod rms_norm;
mod rows;
mod swiglu;
#[cfg(target_arch = "x86_64")]
pub(super) mod x86;

pub(super) use cross_entropy::{log_normalisers, losses};

/// The operations of [`Kernels`](super::Kernels), on the tensors of a backend.
#[backend_extension(Flex, Autodiff)]
pub trait OwnOps: Backend {
    /// See [`Kernels::rms_norm`](super::Kernels::rms_norm).
    fn own_rms_norm(
        x_nd: FloatTensor<Self>,
        gamma_d: FloatTensor<Self>,
        epsilon: f32,
    ) -> FloatTensor<Self>;

    /// See [`Kernels::attention`](super::Kernels::attention).
    fn own_attention(
        qkv_n3d: FloatTensor<Self>,
        n_head: usize,
        layout: Arc<SequenceLayout>,
        rope: Arc<Rope>,
    ) -> FloatTensor<Self>;

    /// See [`Kernels::swiglu`](super::Kernels::swiglu).
    fn own_swiglu(gate_up_n2f: FloatTensor<Self>) -> FloatTensor<Self>;

    /// See [`Kernels::cross_entropy`](super::Kernels::cross_entropy).
    fn own_cross_entropy(logits_nv: FloatTensor<Self>, targets: Arc<[u32]>) -> FloatTensor<Self>;

    /// See [`Kernels::select_rows`](super::Kernels::select_rows).
    fn own_select_rows(x_md: FloatTensor<Self>, rows: Arc<[u32]>) -> FloatTensor<Self>;
}
