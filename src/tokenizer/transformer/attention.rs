//! [`SelfAttention`] of packed rows, and [`CrossAttention`] from frames to what is known of them.

use burn::module::Module;
use burn::tensor::activation::softmax;
use burn::tensor::{Bool, Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use super::linear::Linear;
use crate::ops::{AttentionOptions, Kernels, MASKED, Rope, rotate};

/// Multi-head attention with rotary positions, with biases: Attention(x W_qkv + b) W_o + b.
#[derive(Module, Debug)]
pub struct SelfAttention {
    /// `[d, 3d]`: queries, keys, values.
    qkv: Linear,
    output: Linear,
}

impl SelfAttention {
    /// Weights of deviation `std`.
    pub fn new(width: usize, std: f64, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            qkv: Linear::new([width, 3 * width], std, rng, device),
            output: Linear::new([width, width], std, rng, device),
        }
    }

    /// `[n, d]` to the same.
    pub fn forward(&self, x_nd: Tensor<2>, options: &AttentionOptions) -> Tensor<2> {
        let qkv_n3d = self.qkv.forward(x_nd);
        let kernels = Kernels::for_device(&qkv_n3d.device());
        self.output.forward(kernels.attend(qkv_n3d, options))
    }
}

/// Rows that frames attend to: s of each clip.
#[derive(Clone, Debug)]
pub struct Memory {
    /// `[b·s, d]`.
    rows_nd: Tensor<2>,
    n_clips: usize,
    /// True where a row is padding, `[b, 1, 1, s]`; `None` where none is.
    padding: Option<Tensor<4, Bool>>,
    /// Angles of the rows, and of the frames that attend to them.
    ropes: Option<[Rope; 2]>,
}

impl Memory {
    /// Rows of clips, as many each, `[b·s, d]`.
    pub fn even(rows_nd: Tensor<2>, n_clips: usize, ropes: Option<[Rope; 2]>) -> Self {
        Self { rows_nd, n_clips, padding: None, ropes }
    }

    /// Rows of clips, `counts` of each and at least one, one clip after the other.
    pub fn ragged(rows_nd: Tensor<2>, counts: &[usize]) -> Self {
        let (b, longest) = (counts.len(), counts.iter().copied().max().unwrap_or(0));
        let starts = counts.iter().scan(0, |start, count| {
            let own = *start;
            *start += count;
            Some(own)
        });
        let row = |(start, count): (usize, &usize)| {
            let count = *count;
            (0..longest).map(move |i| if i < count { start + i } else { start } as u32)
        };
        let rows = starts.zip(counts).flat_map(row).collect();
        let padding: Vec<bool> =
            counts.iter().flat_map(|&count| (0..longest).map(move |i| i >= count)).collect();
        let device = rows_nd.device();
        let padding = Tensor::from_data(TensorData::new(padding, [b, 1, 1, longest]), &device);
        let rows_nd = Kernels::for_device(&device).select_rows(rows_nd, &rows);
        Self { rows_nd, n_clips: b, padding: Some(padding), ropes: None }
    }
}

/// Multi-head attention from frames to a memory, without causality.
#[derive(Module, Debug)]
pub struct CrossAttention {
    query: Linear,
    /// `[d, 2d]`: keys, values.
    key_value: Linear,
    output: Linear,
    #[module(skip)]
    n_head: usize,
}

impl CrossAttention {
    /// Weights of deviation `std`.
    pub fn new(
        [width, n_head]: [usize; 2],
        std: f64,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        Self {
            query: Linear::new([width, width], std, rng, device),
            key_value: Linear::new([width, 2 * width], std, rng, device),
            output: Linear::new([width, width], std, rng, device),
            n_head,
        }
    }

    /// `[b·f, d]` to the same.
    pub fn forward(&self, x_nd: Tensor<2>, memory: &Memory) -> Tensor<2> {
        let [n, d] = x_nd.dims();
        let key_value = self.key_value.forward(memory.rows_nd.clone());
        let rows = key_value.dims()[0];
        let part = |part: usize| key_value.clone().slice([0..rows, part * d..(part + 1) * d]);
        let heads = |x_nd: Tensor<2>| self.heads(x_nd, memory.n_clips);
        let (mut queries, mut keys) = (heads(self.query.forward(x_nd)), heads(part(0)));
        if let Some([rows, frames]) = &memory.ropes {
            (queries, keys) = (rotate(queries, frames), rotate(keys, rows));
        }
        let scale = ((d / self.n_head) as f64).sqrt();
        let mut scores_bhfs = queries.div_scalar(scale).matmul(keys.swap_dims(2, 3));
        if let Some(padding) = &memory.padding {
            let hidden = padding.clone().expand(scores_bhfs.dims());
            scores_bhfs = scores_bhfs.mask_fill(hidden, MASKED);
        }
        let mixed = softmax(scores_bhfs, 3).matmul(heads(part(1)));
        self.output.forward(mixed.swap_dims(1, 2).reshape([n, d]))
    }

    /// Rows of `b` clips by head, `[b, h, rows of a clip, d/h]`.
    fn heads(&self, x_nd: Tensor<2>, b: usize) -> Tensor<4> {
        let [n, d] = x_nd.dims();
        x_nd.reshape([b, n / b, self.n_head, d / self.n_head]).swap_dims(1, 2)
    }
}
