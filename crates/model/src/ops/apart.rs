//! The parts of a block by themselves, for blocks that are put together otherwise: what stands around
//! them is the caller's, such as biases, other norms, or no residual.

use burn::tensor::Tensor;

use super::own::{self, RmsNorm, SwiGlu};
use super::{AttentionOptions, CrossOptions, Kernels, plain, shapes};

impl Kernels {
    /// Attention alone, of the columns `[q | k | v]` of [`Kernels::attention`]: a of its equations,
    /// `[n, d]`. What stands around it is the caller's: other norms, biases, no residual.
    ///
    /// # Panics
    ///
    /// As [`Kernels::attention`].
    pub fn attend(self, qkv_n3d: Tensor<2>, options: &AttentionOptions) -> Tensor<2> {
        let [n, columns] = qkv_n3d.dims();
        shapes::attention([n, columns / 3], [columns / 3, columns], options);
        match self {
            Kernels::Plain | Kernels::Half(_) => plain::attention(qkv_n3d, options, self.product()),
            Kernels::Own => own::of_one(options.clone(), qkv_n3d),
        }
    }

    /// Attention from queries to a memory, `[k | v]`: a = softmax(q̂ k̂ᵀ / √head_dim) v, over all rows
    /// of the memory of the query's sequence, with gradients as those of [`Kernels::attention`];
    /// `[n, d]`.
    ///
    /// # Panics
    ///
    /// If the shapes are not those of the layout, heads and angles.
    pub fn cross_attend(
        self,
        queries_nd: Tensor<2>,
        key_values_m2d: Tensor<2>,
        options: &CrossOptions,
    ) -> Tensor<2> {
        shapes::cross_attention(queries_nd.dims(), key_values_m2d.dims(), options);
        match self {
            Kernels::Plain | Kernels::Half(_) => {
                plain::cross_attention(queries_nd, key_values_m2d, options, self.product())
            }
            Kernels::Own => own::of_two(options.clone(), queries_nd, key_values_m2d),
        }
    }

    /// RMSNorm alone, x r γ with r = 1 / √(mean(x²) + ε) in each row, `[n, d]`.
    ///
    /// # Panics
    ///
    /// If there is not one γ for each column.
    pub fn rms_norm(self, x_nd: Tensor<2>, gamma_d: Tensor<1>, epsilon: f32) -> Tensor<2> {
        assert_eq!([x_nd.dims()[1]], gamma_d.dims(), "rms_norm: rows and gains of one width");
        match self {
            Kernels::Plain | Kernels::Half(_) => plain::rms_norm(x_nd, gamma_d, epsilon),
            Kernels::Own => own::of_two(RmsNorm { epsilon }, x_nd, gamma_d),
        }
    }

    /// [`SwiGlu`](super::Activation::SwiGlu) alone, of columns `[gate | up]`, `[n, f]`.
    ///
    /// # Panics
    ///
    /// If the number of columns is odd.
    pub fn swi_glu(self, gate_up_n2f: Tensor<2>) -> Tensor<2> {
        assert!(gate_up_n2f.dims()[1].is_multiple_of(2), "swi_glu: as many gates as values");
        match self {
            Kernels::Plain | Kernels::Half(_) => plain::swiglu(gate_up_n2f),
            Kernels::Own => own::of_one(SwiGlu, gate_up_n2f),
        }
    }
}
