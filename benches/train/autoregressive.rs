//! Shapes of the autoregressive transformer.

use burn::optim::GradientsParams;
use burn::tensor::Device;
use isoflop::generator::Network;
use isoflop::generator::autoregressive::{Batch, Model, Sequence, Transformer, end_token};
use isoflop::learn::adamw::AdamW;
use isoflop::ops::Kernels;
use isoflop::spec::flops::{TRAINING_PER_FORWARD, exact_of_sequence};
use isoflop::spec::{Ffn, ModelShape};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::{Case, Stepper, optimiser};

/// One shape to time.
#[derive(Clone, Copy)]
pub struct Autoregressive {
    name: &'static str,
    n_layer: usize,
    n_head: usize,
    d_model: usize,
    n_vocab: usize,
    /// Text vectors before each clip.
    n_text: usize,
    /// Codes of a clip; its targets are one more, the end token.
    n_codes: usize,
    clips: usize,
}

const fn case(name: &'static str, numbers: [usize; 7]) -> Autoregressive {
    let [n_layer, n_head, d_model, n_vocab, n_text, n_codes, clips] = numbers;
    Autoregressive { name, n_layer, n_head, d_model, n_vocab, n_text, n_codes, clips }
}

pub const CASES: [Autoregressive; 8] = [
    case("quickstart-d16-V240", [2, 1, 16, 240, 16, 36, 7]),
    case("quickstart-d24-V1000", [2, 2, 24, 1000, 16, 36, 7]),
    case("quickstart-d32-V1000", [2, 2, 32, 1000, 16, 36, 7]),
    case("motion-V1000", [4, 4, 64, 1000, 32, 50, 32]),
    case("motion-V64000", [4, 4, 64, 64_000, 32, 50, 32]),
    case("S0", [2, 2, 64, 512, 1, 63, 32]),
    case("S1", [4, 4, 128, 1024, 1, 63, 32]),
    case("S2", [6, 4, 256, 4096, 1, 63, 32]),
];

/// Cases that plain kernels take too long for.
const OWN_ALONE: [&str; 2] = ["motion-V64000", "S2"];

impl Autoregressive {
    fn shape(&self) -> ModelShape {
        ModelShape {
            n_layer: self.n_layer,
            n_head: self.n_head,
            d_model: self.d_model,
            d_ff: (8 * self.d_model / 3).next_multiple_of(8),
            n_ctx: self.n_text + self.n_codes + 1,
            d_text: 64,
            ffn: Ffn::SwiGlu,
            tie_embeddings: false,
            rope_base: 10_000.0,
        }
    }

    fn batch(&self, d_text: usize) -> Batch {
        let text = vec![0.5; self.n_text * d_text];
        let codes: Vec<u32> = (0..self.n_codes).map(|i| (i * 7 % self.n_vocab) as u32).collect();
        let sequence = Sequence { text: &text, codes: &codes, from: 0, to: self.n_codes + 1 };
        Batch::pack(&vec![sequence; self.clips], d_text, end_token(self.n_vocab))
    }
}

impl Case for Autoregressive {
    fn name(&self) -> &'static str {
        self.name
    }

    fn kernels(&self) -> &[Kernels] {
        let is_slow = OWN_ALONE.contains(&self.name);
        if is_slow { &[Kernels::Own] } else { &[Kernels::Own, Kernels::Plain] }
    }

    fn tokens(&self) -> usize {
        self.clips * (self.n_codes + 1)
    }

    fn flops(&self) -> f64 {
        let (prefix, targets) = (self.n_text as f64, (self.n_codes + 1) as f64);
        let forward = exact_of_sequence(&self.shape(), self.n_vocab, prefix, targets);
        self.clips as f64 * forward * TRAINING_PER_FORWARD
    }

    fn stepper(&self, kernels: Kernels) -> Stepper {
        let device = Device::flex().autodiff();
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let shape = self.shape();
        let batch = self.batch(shape.d_text);
        let weights = Transformer::init(&shape, self.n_vocab, &mut rng, &device);
        let mut model = Model::new(weights, &shape, self.n_vocab, kernels, &device);
        let mut optimiser: AdamW = optimiser();
        Box::new(move || {
            let loss = model.loss(&batch);
            let value = loss.clone().into_scalar::<f32>();
            let gradients = GradientsParams::from_grads(loss.backward(), &model.weights);
            model.weights = optimiser.step(model.weights.clone(), gradients, 1.0, 1e-3).0;
            value
        })
    }
}
