//! Made-up codes and captions in the files that a trainer reads, and a small run over them.

use isoflop::codes::{Grid, SplitTokens, TokenStore, write_store};
use isoflop::data::{DataError, Metadata, MotionSource, Split, UNIT_FRAMES};
use isoflop::generator::Inputs;
use isoflop::spec::ModelShape;
use isoflop::spec::RunSpec;
use isoflop::spec::{Ffn, GeneratorSpec, Precision, Share, ShownCaptions};
use isoflop::text::{HashedNgrams, TextStore, embed};

/// Width of the text vectors.
pub const D_TEXT: usize = 8;

/// The clips of one split.
pub type Clips = Vec<Vec<u32>>;

/// Stores of codes and captions, in files that go when it goes.
pub struct Corpus {
    pub tokens: TokenStore,
    pub text: TextStore,
    _folder: tempfile::TempDir,
}

impl Corpus {
    /// Writes and opens the clips of train, val and test; clip i of a split has `captions(i)`.
    pub fn new(n_vocab: usize, clips: [Clips; 3], captions: fn(usize) -> Vec<String>) -> Self {
        Self::of_grid(&Grid::stream(n_vocab, UNIT_FRAMES), clips, captions)
    }

    /// The same for clips with codes on several scales, of one length each.
    pub fn of_grid(grid: &Grid, clips: [Clips; 3], captions: fn(usize) -> Vec<String>) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [tokens, text] = ["tokens", "text"].map(|name| folder.path().join(name));
        let frames = |clip: &Vec<u32>| UNIT_FRAMES * clip.len() / grid.scales.len();
        let splits = clips
            .each_ref()
            .map(|clips| SplitTokens::new(clips.iter().map(|clip| (&clip[..], frames(clip)))));
        write_store(&tokens, grid, &splits).expect("a writable folder");
        let digest = "made up".to_string();
        let metadata = Metadata { fps: 20.0, digest, ..Metadata::default() };
        let source = Captioned { clips, captions, metadata };
        embed(&HashedNgrams::new(D_TEXT, 6), &source, &text).expect("a writable folder");
        Self {
            tokens: TokenStore::open(&tokens).expect("just written"),
            text: TextStore::open(&text).expect("just written"),
            _folder: folder,
        }
    }

    pub fn inputs(&self) -> Inputs<'_> {
        Inputs { tokens: &self.tokens, text: &self.text, scales: None }
    }
}

/// A source of captions whose motion nobody asks for.
struct Captioned {
    clips: [Clips; 3],
    captions: fn(usize) -> Vec<String>,
    metadata: Metadata,
}

impl MotionSource for Captioned {
    fn n_clips(&self, split: Split) -> usize {
        self.clips[split as usize].len()
    }

    fn n_frames(&self, split: Split, index: usize) -> usize {
        UNIT_FRAMES * self.clips[split as usize][index].len()
    }

    fn captions(&self, _: Split, index: usize) -> Vec<String> {
        (self.captions)(index)
    }

    fn features(&self, split: Split, index: usize) -> Result<Vec<f32>, DataError> {
        let path = self.clip_id(split, index);
        Err(DataError::Invalid { path, problem: "has codes and no motion".to_owned() })
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }
}

/// A run of a few steps of a model of two layers.
pub fn small_run(n_vocab: usize) -> RunSpec {
    RunSpec {
        revision: isoflop::spec::TRAINING_REVISION,
        seed: 3,
        generator: GeneratorSpec::Autoregressive(ModelShape {
            n_layer: 2,
            n_head: 2,
            d_model: 16,
            d_ff: 24,
            n_ctx: 40,
            d_text: D_TEXT,
            ffn: Ffn::SwiGlu,
            tie_embeddings: false,
            rope_base: 10_000.0,
        }),
        codes: Grid::stream(n_vocab, UNIT_FRAMES),
        budget_flops: 1e9,
        batch_tokens: 37,
        steps: 13,
        lr: 3e-3,
        warmup_steps: 3,
        final_share: 0.1,
        decay_steps: None,
        precision: Precision::F32,
        weight_decay: 0.01,
        betas: [0.9, 0.99],
        epsilon: 1e-8,
        clip_norm: Some(1.0),
        evaluations: 4,
        fps: 20.0,
        data_digest: "made up".to_owned(),
        text_id: "made up".to_owned(),
        tokenizer_id: "made up".to_owned(),
        trainer: None,
        varied: None,
        share: Share::WHOLE,
        captions: ShownCaptions::Drawn,
    }
}
