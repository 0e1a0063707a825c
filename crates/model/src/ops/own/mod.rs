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
//! | [`elements`] | flex's tensors |
//! | [`autodiff`] | what an operation on them is, with gradients |
//! | [`flex`] | the operations |
//! | [`apart`] | attention, RMSNorm and SwiGLU without what usually stands around them |
//!
//! Every kernel runs on the calling thread and reduces in a fixed order: the same input gives the
//! same bits. The way back writes over what the way forward kept and over the gradient that it is
//! given, wherever nobody else holds it, so it allocates next to nothing.

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
pub use apart::{RmsNorm, SwiGlu};
pub use autodiff::{of_four, of_one, of_three, of_two};
pub use flex::{FeedForward, HeadLoss, OwnUpdates, SelectRows};
