//! Our operations on the CPU device `flex`, and their autodiff.
//!
//! | file | content |
//! | --- | --- |
//! | [`lanes`], [`x86`] | sixteen numbers at a time, on the machine's vectors |
//! | [`buffers`] | memory reused from step to step; flex's tensors |
//! | [`matmul`], [`panels`] | products of large matrices |
//! | [`small_matrices`] | products of small ones |
//! | [`rows`] | eˣ, sums, RMSNorm, and picking rows |
//! | [`attention`], [`feed_forward`], [`head`] | the parts of the model |
//! | [`convolution`] | the layers of tokenizers |
//! | [`detached`] | operations without gradients: losses of rows, the codes of latents, the optimiser |
//!
//! An [`Operation`] defines the data kept by the forward pass, and the backward pass. Every kernel runs on the calling
//! thread and reduces in a fixed order: the same input gives the same bits. The backward pass overwrites kept data and
//! its input gradient if they are not shared, so it allocates almost nothing.

mod attention;
mod buffers;
mod convolution;
mod detached;
mod feed_forward;
mod head;
mod lanes;
mod matmul;
mod panels;
mod rows;
mod small_matrices;
mod vectors;
#[cfg(target_arch = "x86_64")]
pub(super) mod x86;

use std::fmt::Debug;
use std::marker::PhantomData;

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, Flex, backend_extension};
use burn::tensor::Tensor;
use burn_flex::FlexTensor;

use buffers::{contiguous, elements};

pub use detached::{AdamWStep, adamw, head_nll, nearest, sum_of_squares};
pub use feed_forward::{FeedForward, SwiGlu};
pub use head::HeadLoss;
pub use lanes::LANES;
pub use rows::{RmsNorm, SelectRows};
pub use vectors::vectors;

/// An operation on `N` contiguous tensors, with its options.
pub trait Operation<const N: usize>: Clone + Debug + Send + 'static {
    /// The data of the backward pass, besides the options.
    type Kept: Clone + Debug + Send + 'static;

    /// The output, and the kept data if `keep` is set.
    fn forward(&self, inputs: &[FlexTensor; N], keep: bool) -> (FlexTensor, Option<Self::Kept>);

    /// The gradients by the inputs, given the gradient by the output.
    fn backward(&self, kept: Self::Kept, above: Above<N>) -> Gradients<N>;
}

/// The gradient by the output, and whether those by the inputs are wanted.
pub type Above<const N: usize> = (FlexTensor, [bool; N]);

/// The gradient by each input; `None` if it was not wanted.
pub type Gradients<const N: usize> = [Option<FlexTensor>; N];

/// The operations on so many tensors of a backend, and of burn's own type.
macro_rules! operations {
    ($($name:ident $n:tt: $($input:ident $rank:ident),*;)*) => {
        /// The own operations, on the tensors of a backend.
        #[backend_extension(Flex, Autodiff)]
        pub trait OwnOps: Backend {
            $(
                /// An operation on so many tensors.
                fn $name<O: Operation<$n>>(
                    operation: O,
                    $($input: FloatTensor<Self>),*
                ) -> FloatTensor<Self>;
            )*
        }

        impl OwnOps for Flex {
            $(fn $name<O: Operation<$n>>(operation: O, $($input: FlexTensor),*) -> FlexTensor {
                forward(&operation, [$($input),*], false).0
            })*
        }

        impl<C: CheckpointStrategy> OwnOps for Autodiff<Flex, C> {
            $(fn $name<O: Operation<$n>>(
                operation: O,
                $($input: FloatTensor<Self>),*
            ) -> FloatTensor<Self> {
                tracked::<C, O, $n>(operation, [$($input),*])
            })*
        }

        $(
            /// Applies an operation to tensors, with gradients if they track them.
            pub fn $name<O: Operation<$n>, $(const $rank: usize,)* const OUTPUT: usize>(
                operation: O,
                $($input: Tensor<$rank>),*
            ) -> Tensor<OUTPUT> {
                Tensor::from_dispatch(Dispatch::$name(operation, $($input.into_dispatch()),*))
            }
        )*
    };
}

operations! {
    of_one 1: a A;
    of_two 2: a A, b B;
    of_three 3: a A, b B, c C;
    of_four 4: a A, b B, c C, d D;
}

fn forward<O: Operation<N>, const N: usize>(
    operation: &O,
    inputs: [FlexTensor; N],
    keep: bool,
) -> (FlexTensor, Option<O::Kept>) {
    let inputs = inputs.map(contiguous);
    operation.forward(&inputs, keep)
}

/// Keeps the data of the backward pass, if there is one.
fn tracked<S: CheckpointStrategy, O: Operation<N>, const N: usize>(
    operation: O,
    inputs: [FloatTensor<Autodiff<Flex, S>>; N],
) -> FloatTensor<Autodiff<Flex, S>> {
    let nodes = inputs.each_ref().map(|input| input.node());
    let inputs = inputs.map(|input| input.into_primitive());
    match WayBack(PhantomData::<O>).prepare::<S>(nodes).compute_bound().stateful() {
        OpsKind::UnTracked(prep) => prep.finish(forward(&operation, inputs, false).0),
        OpsKind::Tracked(prep) => {
            let (output, kept) = forward(&operation, inputs, true);
            prep.finish((operation, kept.expect("asked for")), output)
        }
    }
}

/// The way back of an operation.
#[derive(Debug)]
struct WayBack<O>(PhantomData<O>);

impl<O: Operation<N>, const N: usize> Backward<Flex, N> for WayBack<O> {
    type State = (O, O::Kept);

    fn backward(
        self,
        ops: Ops<Self::State, N>,
        grads: &mut grads::Gradients,
        _: &mut Checkpointer,
    ) {
        let (operation, kept) = ops.state;
        let gradient = contiguous(grads.consume::<Flex>(&ops.node));
        assert!(!elements(&gradient).is_empty(), "a gradient has rows");
        let wanted = ops.parents.each_ref().map(Option::is_some);
        let by = operation.backward(kept, (gradient, wanted));
        for (parent, by) in ops.parents.into_iter().zip(by) {
            if let (Some(parent), Some(by)) = (parent, by) {
                grads.register::<Flex>(parent.id, by);
            }
        }
    }
}
