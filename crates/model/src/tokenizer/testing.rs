//! A small source of motion for tests.

use crate::data::{DataError, FeatureStats, Metadata, MotionSource, Split};
use crate::spec::{
    ArchitectureSpec, Codes, ConvolutionalSpec, LanguagePlace, LanguageSpec, PatchSpec,
    QuantizerSpec, TokenizerSpec, TokenizerTraining, TransformerSpec,
};
use crate::text::{HashedNgrams, TextStore, embed};

/// Clips of sine waves, the same lengths in every split.
pub struct Waves {
    lengths: Vec<usize>,
    /// So many of these are long ones.
    pub n_long: usize,
    pub metadata: Metadata,
    /// A clip that is full of NaN.
    pub spoiled: Option<(Split, usize)>,
}

impl Waves {
    pub fn new(lengths: &[usize], n_features: usize) -> Self {
        let mean = (0..n_features).map(|f| f as f32 * 0.01).collect();
        let std = (0..n_features).map(|f| 0.5 + (f % 3) as f32).collect();
        let (stats, digest) = (FeatureStats { mean, std }, "waves".to_string());
        let metadata = Metadata { stats, fps: 20.0, digest, ..Metadata::default() };
        Self { lengths: lengths.to_vec(), n_long: 0, metadata, spoiled: None }
    }

    /// Features of clip `index`; another `phase` is another clip.
    pub fn clip(&self, phase: usize, index: usize) -> Vec<f32> {
        let stats = self.stats();
        let n_features = stats.mean.len();
        let value = |i: usize| {
            let (frame, feature) = ((i / n_features) as f32, i % n_features);
            let angle = frame * (0.1 + 0.05 * (index % 5) as f32) + (phase + feature % 4) as f32;
            stats.mean[feature] + stats.std[feature] * 1.4 * angle.sin()
        };
        (0..self.lengths[index] * n_features).map(value).collect()
    }
}

impl MotionSource for Waves {
    fn n_clips(&self, _: Split) -> usize {
        self.lengths.len() - self.n_long
    }

    fn n_long(&self) -> usize {
        self.n_long
    }

    fn n_frames(&self, _: Split, index: usize) -> usize {
        self.lengths[index]
    }

    fn captions(&self, _: Split, index: usize) -> Vec<String> {
        vec!["a wave".to_string(), format!("someone waves {} times", index + 1)]
    }

    fn features(&self, split: Split, index: usize) -> Result<Vec<f32>, DataError> {
        let clip = self.clip(split as usize, index);
        match self.spoiled {
            Some(spoiled) if spoiled == (split, index) => Ok(vec![f32::NAN; clip.len()]),
            _ => Ok(clip),
        }
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }
}

/// The captions of a source as vectors of `dim` numbers.
pub fn text_of(source: &dyn MotionSource, dim: usize) -> TextStore {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("vectors.safetensors");
    embed(&HashedNgrams::new(dim, 9), source, &path).unwrap();
    TextStore::open(&path).unwrap()
}

/// Width of a word's vector in specs with language.
pub const D_TEXT: usize = 6;

/// A spec that trains in a moment.
pub fn small_spec() -> TokenizerSpec {
    let sizes = ConvolutionalSpec { width: 8, depth: 2, ..Default::default() };
    let (window, batch, steps, lr, warmup_steps) = (16, 8, 5, 5e-3, 2);
    let defaults = TokenizerTraining::default();
    TokenizerSpec {
        architecture: ArchitectureSpec::Convolutional(sizes),
        quantizer: QuantizerSpec::Fsq { levels: vec![5, 3] },
        training: TokenizerTraining { window, batch, steps, lr, warmup_steps, ..defaults },
        ..TokenizerSpec::default()
    }
}

/// One of patches that trains in a moment.
pub fn patch_spec(quantizer: QuantizerSpec, steps: usize) -> TokenizerSpec {
    let (encoder_blocks, decoder_blocks) = (1, 1);
    let sizes =
        PatchSpec { width: 8, latent: 4, encoder_blocks, decoder_blocks, ..Default::default() };
    let (window, batch, lr, warmup_steps) = (32, 4, 1e-2, 2);
    let defaults = TokenizerTraining::of_patches();
    TokenizerSpec {
        architecture: ArchitectureSpec::Patch(sizes),
        quantizer,
        training: TokenizerTraining { window, batch, steps, lr, warmup_steps, ..defaults },
        ..TokenizerSpec::default()
    }
}

/// One of patches whose codes stay where k-means places them.
pub fn fixed_spec(n_vocab: usize, steps: usize) -> TokenizerSpec {
    let mut spec = patch_spec(QuantizerSpec::Vq { n_vocab }, steps);
    if let ArchitectureSpec::Patch(sizes) = &mut spec.architecture {
        (sizes.encoder_blocks, sizes.codes) = (0, Codes::Fixed);
    }
    spec
}

/// One of a transformer that trains in a moment; some of its halves see captions.
pub fn transformer_spec(
    at: &[LanguagePlace],
    quantizer: QuantizerSpec,
    steps: usize,
) -> TokenizerSpec {
    let at = at.to_vec();
    let language = LanguageSpec { at, drop: 0.3, dim: D_TEXT, max_tokens: 9 };
    let sizes = TransformerSpec {
        width: 8,
        heads: 2,
        latent: 4,
        span: 16,
        dropout: 0.1,
        language: (!language.at.is_empty()).then_some(language),
        ..TransformerSpec::default()
    };
    let (window, batch, lr, warmup_steps) = (16, 8, 1e-2, 2);
    let defaults = TokenizerTraining::of_transformers();
    TokenizerSpec {
        architecture: ArchitectureSpec::Transformer(sizes),
        quantizer,
        training: TokenizerTraining { window, batch, steps, lr, warmup_steps, ..defaults },
        ..TokenizerSpec::default()
    }
}

/// The same with another quantizer and number of steps.
pub fn spec_of(quantizer: QuantizerSpec, steps: usize) -> TokenizerSpec {
    let mut spec = TokenizerSpec { quantizer, ..small_spec() };
    spec.training.steps = steps;
    spec
}
