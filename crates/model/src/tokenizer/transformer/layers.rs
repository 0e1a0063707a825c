//! [`Layers`]: the U that both halves are made of.
//!
//! Shapes: n rows of all clips, d width, c channels.

use burn::module::{Module, Param};
use burn::tensor::activation::gelu;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::packing::EPSILON;
use crate::learn::params::{constant, normal};
use crate::ops::{AttentionOptions, Convolution, CrossOptions, Kernels, Taps};
use crate::spec::{Ffn, TokenizerNorm, TransformerSpec};
use crate::tokenizer::halves::Pass;

/// The deviation of a layer's weights at the beginning: LG-Tok's 0.02 at its width of 256, with
/// which rows stay of one size at any other.
pub fn deviation(width: usize) -> f64 {
    0.02 * (256.0 / width as f64).sqrt()
}

/// Learned rows, initialised as in LG-Tok: N(0, 1/d).
pub fn learned_rows(
    [n, width]: [usize; 2],
    rng: &mut ChaCha8Rng,
    device: &Device,
) -> Param<Tensor<2>> {
    normal([n, width], (width as f64).sqrt().recip(), rng, device)
}

/// x W + b.
#[derive(Module, Debug)]
pub struct Linear {
    /// `[c_in, c_out]`.
    weight: Param<Tensor<2>>,
    /// `[c_out]`.
    bias: Param<Tensor<1>>,
}

impl Linear {
    /// Weights N(0, std²) and no bias, as LG-Tok begins.
    pub fn new(channels: [usize; 2], std: f64, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let bias = constant([channels[1]], 0.0, device);
        Self { weight: normal(channels, std, rng, device), bias }
    }

    /// The device of the weights.
    pub fn device(&self) -> Device {
        self.weight.device()
    }

    /// `[n, c_in]` to `[n, c_out]`.
    pub fn forward(&self, x_nc: Tensor<2>) -> Tensor<2> {
        let alone = Convolution { n_clips: 1, taps: Taps::Point, rectify: false };
        let kernels = Kernels::for_device(&x_nc.device());
        kernels.convolve(x_nc, self.weight.val(), self.bias.val(), alone)
    }
}

/// Multi-head attention with rotary positions, with biases: Attention(x W_qkv + b) W_o + b.
#[derive(Module, Debug)]
struct SelfAttention {
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

/// Rows that frames attend to, grouped by clip.
#[derive(Clone, Debug)]
pub struct Memory {
    /// `[m, d]`.
    pub rows_md: Tensor<2>,
    /// The mask from frames to rows.
    pub options: CrossOptions,
}

/// Multi-head attention from frames to a memory, without causality.
#[derive(Module, Debug)]
struct CrossAttention {
    query: Linear,
    /// `[d, 2d]`: keys, values.
    key_value: Linear,
    output: Linear,
}

impl CrossAttention {
    /// Weights of deviation `std`.
    pub fn new(width: usize, std: f64, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            query: Linear::new([width, width], std, rng, device),
            key_value: Linear::new([width, 2 * width], std, rng, device),
            output: Linear::new([width, width], std, rng, device),
        }
    }

    /// `[b·f, d]` to the same.
    pub fn forward(&self, x_nd: Tensor<2>, memory: &Memory) -> Tensor<2> {
        let kernels = Kernels::for_device(&x_nd.device());
        let key_values = self.key_value.forward(memory.rows_md.clone());
        let queries_nd = self.query.forward(x_nd);
        self.output.forward(kernels.cross_attend(queries_nd, key_values, &memory.options))
    }
}

/// The memory of a half's rows.
pub struct Seen {
    pub options: AttentionOptions,
    pub latents: Option<Memory>,
    pub text: Option<Memory>,
}

/// RMSNorm, or LayerNorm, which is RMSNorm of what differs from the row's mean, plus a bias.
#[derive(Module, Debug)]
struct Norm {
    /// `[d]`.
    gain: Param<Tensor<1>>,
    /// `[d]`, LayerNorm's.
    bias: Option<Param<Tensor<1>>>,
}

impl Norm {
    fn new(sizes: &TransformerSpec, device: &Device) -> Self {
        let filled = |value| constant([sizes.width], value, device);
        let bias = (sizes.norm == TokenizerNorm::Layer).then(|| filled(0.0));
        Self { gain: filled(1.0), bias }
    }

    fn forward(&self, x_nd: Tensor<2>) -> Tensor<2> {
        let kernels = Kernels::for_device(&x_nd.device());
        let normed = |x_nd| kernels.rms_norm(x_nd, self.gain.val(), EPSILON);
        match &self.bias {
            None => normed(x_nd),
            Some(bias) => normed(x_nd.clone() - x_nd.mean_dim(1)) + bias.val().unsqueeze(),
        }
    }
}

/// With biases, SwiGLU, (silu(x W_gate + b) ∘ (x W_up + b)) W_down + b, or gelu(x W_up + b) W_down + b.
#[derive(Module, Debug)]
struct FeedForward {
    /// `[d, 2f]`: gate, up; with GELU `[d, f]`.
    up: Linear,
    down: Linear,
    #[module(skip)]
    ffn: Ffn,
}

impl FeedForward {
    fn new(sizes: &TransformerSpec, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        let &TransformerSpec { width, ffn, .. } = sizes;
        let (std, f) = (deviation(width), sizes.hidden());
        let before = if ffn == Ffn::SwiGlu { 2 * f } else { f };
        Self {
            up: Linear::new([width, before], std, rng, device),
            down: Linear::new([f, width], std, rng, device),
            ffn,
        }
    }

    fn forward(&self, x_nd: Tensor<2>) -> Tensor<2> {
        let before = self.up.forward(x_nd);
        let kernels = Kernels::for_device(&before.device());
        self.down.forward(match self.ffn {
            Ffn::SwiGlu => kernels.swi_glu(before),
            Ffn::Gelu => gelu(before),
        })
    }
}

/// A cross-attention and its norm.
#[derive(Module, Debug)]
struct Cross {
    norm: Norm,
    attention: CrossAttention,
}

/// Attention of the rows to one another, to the latents, to the text, then the feed-forward layer; each part with
/// its norm, after the sum x + part(x) or before the part.
#[derive(Module, Debug)]
struct Layer {
    norm_attention: Norm,
    attention: SelfAttention,
    latents: Option<Cross>,
    text: Option<Cross>,
    norm_ffn: Norm,
    ffn: FeedForward,
    #[module(skip)]
    norm: TokenizerNorm,
    #[module(skip)]
    dropout: f64,
}

impl Layer {
    fn new(
        sizes: &TransformerSpec,
        crosses: [bool; 2],
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let &TransformerSpec { width, norm, dropout, .. } = sizes;
        let std = deviation(width);
        let mut cross = |is_there: bool| {
            let attention = is_there.then(|| CrossAttention::new(width, std, rng, device));
            attention.map(|attention| Cross { norm: Norm::new(sizes, device), attention })
        };
        let [latents, text] = crosses.map(&mut cross);
        Self {
            norm_attention: Norm::new(sizes, device),
            attention: SelfAttention::new(width, std, rng, device),
            latents,
            text,
            norm_ffn: Norm::new(sizes, device),
            ffn: FeedForward::new(sizes, rng, device),
            norm,
            dropout,
        }
    }

    fn forward(&self, x_nd: Tensor<2>, seen: &Seen, pass: &mut Pass) -> Tensor<2> {
        let attend = |x| self.attention.forward(x, &seen.options);
        let mut x_nd = self.add(x_nd, &self.norm_attention, attend, pass);
        for (cross, memory) in [(&self.latents, &seen.latents), (&self.text, &seen.text)] {
            if let (Some(Cross { norm, attention }), Some(memory)) = (cross, memory) {
                x_nd = self.add(x_nd, norm, |x| attention.forward(x, memory), pass);
            }
        }
        self.add(x_nd, &self.norm_ffn, |x| self.ffn.forward(x), pass)
    }

    fn add(
        &self,
        x_nd: Tensor<2>,
        norm: &Norm,
        part: impl FnOnce(Tensor<2>) -> Tensor<2>,
        pass: &mut Pass,
    ) -> Tensor<2> {
        match self.norm {
            TokenizerNorm::Post | TokenizerNorm::Layer => {
                let added = pass.drop(part(x_nd.clone()), self.dropout);
                norm.forward(x_nd + added)
            }
            TokenizerNorm::Pre => {
                let added = part(norm.forward(x_nd.clone()));
                x_nd + pass.drop(added, self.dropout)
            }
        }
    }
}

/// The layers of a half between two norms. With `skips`, the outputs of the first layers are skip connections to the
/// last ones: [x | skip] W + b, in reverse order.
#[derive(Module, Debug)]
pub struct Layers {
    first_norm: Norm,
    layers: Vec<Layer>,
    /// `[2d, d]`, one for each layer after the middle one; none without skips.
    joins: Vec<Linear>,
    last_norm: Norm,
}

impl Layers {
    /// The layers of one half; `crosses` says whether these attend to latents, and to text.
    pub fn new(
        sizes: &TransformerSpec,
        crosses: [bool; 2],
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let &TransformerSpec { width, layers, skips, .. } = sizes;
        let n_joins = if skips { layers / 2 } else { 0 };
        let join = |rng: &mut _| Linear::new([2 * width, width], deviation(width), rng, device);
        Self {
            first_norm: Norm::new(sizes, device),
            layers: (0..layers).map(|_| Layer::new(sizes, crosses, rng, device)).collect(),
            joins: (0..n_joins).map(|_| join(rng)).collect(),
            last_norm: Norm::new(sizes, device),
        }
    }

    /// `[n, d]` to the same.
    pub fn forward(&self, x_nd: Tensor<2>, seen: &Seen, pass: &mut Pass) -> Tensor<2> {
        let half = self.layers.len() / 2;
        let mut x_nd = self.first_norm.forward(x_nd);
        let mut given = Vec::with_capacity(half);
        for (i, layer) in self.layers.iter().enumerate() {
            let join = i.checked_sub(half + 1).and_then(|after| self.joins.get(after));
            if let Some(join) = join {
                let earlier = given.pop().expect("as many as there are joins");
                x_nd = join.forward(Tensor::cat(vec![x_nd, earlier], 1));
            }
            x_nd = layer.forward(x_nd, seen, pass);
            if i < self.joins.len() {
                given.push(x_nd.clone());
            }
        }
        self.last_norm.forward(x_nd)
    }
}
