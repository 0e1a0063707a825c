//! [`TransformerEncoder`]: frames, and the words of a caption, to latents.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::config::{deviation, languages, learned_rows};
use super::layer::{Crossing, Layers, Seen};
use super::linear::Linear;
use super::packing::{Packing, Places, by_pieces};
use crate::learn::layers::Conv1d;
use crate::motion::POSITIONS;
use crate::spec::TransformerSpec;
use crate::tokenizer::architecture::Encode;
use crate::tokenizer::pass::Pass;

/// Learned latents that look at frames and words.
#[derive(Module, Debug)]
pub struct TransformerEncoder {
    /// `[seen features, d]`.
    motion: Linear,
    /// `[most latents of a piece, d]`.
    latents: Param<Tensor<2>>,
    /// `[width of a word's vector, d]`.
    text: Option<Linear>,
    layers: Layers,
    /// d to c, over three neighbouring latents.
    output: Conv1d,
    #[module(skip)]
    n_seen: usize,
    #[module(skip)]
    places: Places,
}

impl TransformerEncoder {
    /// Fresh weights, that see the root and the joints' positions, as in LG-Tok.
    pub fn new(
        sizes: &TransformerSpec,
        n_features: usize,
        rng: &mut ChaCha8Rng,
        device: &Device,
    ) -> Self {
        let ([language, _], n_seen) = (languages(sizes), POSITIONS.end.min(n_features));
        let (width, std) = (sizes.width, deviation(sizes.width));
        Self {
            motion: Linear::new([n_seen, width], std, rng, device),
            latents: learned_rows([sizes.most_latents(), width], rng, device),
            text: language.map(|read| Linear::new([read.dim, width], std, rng, device)),
            layers: Layers::new(sizes, Crossing::default(), rng, device),
            output: Conv1d::same([width, sizes.latent], 1, rng, device),
            n_seen,
            places: Places::of(sizes, language.is_some()),
        }
    }

    /// The latents of clips that are seen at once: `[b, f, seen features]` to `[b, t, c]`.
    fn piece(&self, x_bfs: Tensor<3>, pass: &mut Pass) -> Tensor<3> {
        let [b, f, s] = x_bfs.dims();
        let t = f / self.places.frames;
        let latents_td = self.latents.val().narrow(0, 0, t);
        let d = latents_td.dims()[1];
        let latents_nd = latents_td.unsqueeze::<3>().expand([b, t, d]).reshape([b * t, d]);
        let mut rows = vec![latents_nd, self.motion.forward(x_bfs.reshape([b * f, s]))];
        let (words, text_nd) = self.words(b, pass);
        rows.extend(text_nd);
        let packing = Packing::new([t, f], &words, &self.places);
        let seen = Seen { options: packing.options.clone(), latents: None, text: None };
        let rows_nd = self.layers.forward(packing.pack(rows), &seen, pass);
        self.output.forward(packing.latents(rows_nd).reshape([b, t, d]))
    }

    /// How many words each clip has, and all of them as rows `[words, d]`; a clip that has lost its
    /// caption has none.
    fn words(&self, b: usize, pass: &Pass) -> (Vec<usize>, Option<Tensor<2>>) {
        let Some((text, captions)) = self.text.as_ref().zip(pass.captions) else {
            return (vec![0; b], None);
        };
        let vectors = captions.tensor(&text.device());
        (captions.words().to_vec(), vectors.map(|vectors| text.forward(vectors)))
    }
}

impl Encode for TransformerEncoder {
    fn forward(&self, x_btf: Tensor<3>, pass: &mut Pass) -> Tensor<3> {
        let Places { latents, frames, .. } = self.places;
        let seen = x_btf.narrow(2, 0, self.n_seen);
        by_pieces(seen, latents, frames, |x_bfs| self.piece(x_bfs, pass))
    }
}
