//! Shapes of the scale-by-scale transformer.

use burn::optim::GradientsParams;
use burn::tensor::Device;
use isoflop::codes::{Grid, Length, Scale};
use isoflop::generator::Network;
use isoflop::generator::scalewise::{Batch, Clip, Model};
use isoflop::ops::Kernels;
use isoflop::spec::flops::TRAINING_PER_FORWARD;
use isoflop::spec::{Ffn, ModelShape, Precision, ScalewiseSpec, exact_of_clip};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::{Case, Stepper, optimiser};

/// Latents of a clip of 196 frames.
const LATENTS: usize = 49;

/// Words of a caption, and the width of their vectors.
const WORDS: usize = 16;
const D_TEXT: usize = 64;

const MINI: &[usize] = &[1, 2, 3, 5, 7, 10, 13, 17, 21, 25];
const MID: &[usize] = &[2, 4, 6, 9, 12, 16, 20, 25, 30, 36];
const FULL: &[usize] = &[3, 6, 10, 15, 20, 25, 30, 36, 42, 49];

/// One shape to time.
pub struct Scalewise {
    name: &'static str,
    n_layer: usize,
    n_head: usize,
    d_model: usize,
    d_ff: usize,
    d_latent: usize,
    /// Mean size of a codebook; they have half of it to three halves of it.
    n_vocab: usize,
    /// Codes of each scale.
    lengths: &'static [usize],
    clips: usize,
}

/// A small one, a middle one, and LG-Tok's.
pub fn cases() -> [Scalewise; 3] {
    let case =
        |name, [n_layer, n_head, d_model, d_ff, d_latent, n_vocab, clips]: [usize; 7], lengths| {
            Scalewise { name, n_layer, n_head, d_model, d_ff, d_latent, n_vocab, lengths, clips }
        };
    [
        case("scalewise-nano", [2, 2, 48, 128, 32, 256, 8], MINI),
        case("scalewise-mid", [4, 4, 128, 344, 128, 512, 8], MID),
        case("scalewise-lg-tok", [8, 6, 384, 768, 512, 512, 4], FULL),
    ]
}

impl Scalewise {
    fn grid(&self) -> Grid {
        let steps = self.lengths.len() - 1;
        let scale = |(k, &n): (usize, &usize)| Scale {
            n_vocab: self.n_vocab / 2 + self.n_vocab * k / steps,
            length: Length::Codes(n),
        };
        Grid { scales: self.lengths.iter().enumerate().map(scale).collect(), end_token: false }
    }

    fn spec(&self) -> ScalewiseSpec {
        let shape = ModelShape {
            n_layer: self.n_layer,
            n_head: self.n_head,
            d_model: self.d_model,
            d_ff: self.d_ff,
            n_ctx: WORDS + self.n_codes(),
            d_text: D_TEXT,
            ffn: Ffn::SwiGlu,
            tie_embeddings: false,
            rope_base: 100.0,
        };
        ScalewiseSpec {
            shape,
            d_latent: self.d_latent,
            frames_per_latent: 4,
            most_latents: LATENTS,
            corruption: 0.0,
            text_drop: 0.1,
        }
    }

    fn n_codes(&self) -> usize {
        self.lengths.iter().sum()
    }

    fn batch(&self, model: &Model) -> Batch {
        let (grid, text) = (self.grid(), vec![0.5; WORDS * D_TEXT]);
        let scales = grid.scales.iter().zip(self.lengths);
        let codes: Vec<u32> =
            scales.flat_map(|(s, &n)| (0..n).map(|i| (i * 7 % s.n_vocab) as u32)).collect();
        let clip = Clip {
            text: &text,
            codes: &codes,
            lengths: self.lengths.to_vec(),
            inputs: self.lengths[1..].iter().map(|n| vec![0.5; n * self.d_latent]).collect(),
            length: LATENTS,
            supervised: 0..codes.len(),
        };
        Batch::pack(&vec![clip; self.clips], &grid, D_TEXT, model.places())
    }
}

impl Case for Scalewise {
    fn name(&self) -> &'static str {
        self.name
    }

    /// The model takes the kernels of its device.
    fn kernels(&self) -> &[Kernels] {
        &[Kernels::Own]
    }

    fn tokens(&self) -> usize {
        self.clips * self.n_codes()
    }

    fn flops(&self) -> f64 {
        let lengths = self.lengths;
        let forward = exact_of_clip(&self.spec(), &self.grid(), WORDS, lengths, lengths);
        self.clips as f64 * forward * TRAINING_PER_FORWARD
    }

    fn stepper(&self, _: Kernels) -> Stepper {
        let (spec, device) = (self.spec(), Device::flex().autodiff());
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut model = Model::init(&spec, &self.grid(), Precision::F32, &mut rng, &device);
        let (batch, mut optimiser) = (self.batch(&model), optimiser());
        Box::new(move || {
            let loss = model.loss(&batch);
            let value = loss.clone().into_scalar::<f32>();
            let gradients = GradientsParams::from_grads(loss.backward(), &model.weights);
            model.weights = optimiser.step(model.weights.clone(), gradients, 1.0, 1e-3).0;
            value
        })
    }
}
