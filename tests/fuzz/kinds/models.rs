//! What is kept of models: codes, vectors, weights and what they are weights of.

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

use burn::tensor::Device;
use isoflop::codes::{
    ClipCodes, ClipScale, Grid, Length, Scale, SplitTokens, TokenStore, write_store,
};
use isoflop::data::{self, MotionSource, Split};
use isoflop::evaluator::{self, Evaluator};
use isoflop::files::columns::{self, NewColumn};
use isoflop::motion::N_FEATURES;
use isoflop::progress::Step;
use isoflop::spec::{
    ArchitectureSpec, Clips, ConvolutionalSpec, DataSection, EvaluatorSection, EvaluatorSpec,
    TokenizerSpec, TokenizerTraining,
};
use isoflop::text::{EmbeddingFile, HashedNgrams, TextEncoder, TextStore, caption_key, embed};
use isoflop::tokenizer::{Corpus, Tokenizer, train};
use safetensors::tensor::{Dtype, TensorView, serialize};

use super::words;
use crate::harness::Kind;
use crate::{mutate, tensors};

const FILE: &str = "a.safetensors";

pub const CODES: Kind =
    Kind { name: "codes", file: FILE, seeds: codes_seeds, mutate: tensors::tensors, read: codes };
pub const VECTORS: Kind = Kind {
    name: "vectors",
    file: FILE,
    seeds: vectors_seeds,
    mutate: tensors::tensors,
    read: vectors,
};
pub const EMBEDDINGS: Kind = Kind {
    name: "embeddings",
    file: FILE,
    seeds: embeddings_seeds,
    mutate: tensors::tensors,
    read: embeddings,
};
pub const TOKENIZER: Kind = Kind {
    name: "tokenizer",
    file: "tokenizer.json",
    seeds: |place| kept(place, save_tokenizer, "tokenizer.json"),
    mutate: mutate::text,
    read: tokenizer,
};
pub const TOKENIZER_WEIGHTS: Kind = Kind {
    name: "tokenizer-weights",
    file: "weights.safetensors",
    seeds: |place| kept(place, save_tokenizer, "weights.safetensors"),
    mutate: tensors::tensors,
    read: tokenizer,
};
pub const EVALUATOR: Kind = Kind {
    name: "evaluator",
    file: "evaluator.json",
    seeds: |place| kept(place, save_evaluator, "evaluator.json"),
    mutate: mutate::text,
    read: evaluator,
};
pub const EVALUATOR_WEIGHTS: Kind = Kind {
    name: "evaluator-weights",
    file: "weights.safetensors",
    seeds: |place| kept(place, save_evaluator, "weights.safetensors"),
    mutate: tensors::tensors,
    read: evaluator,
};
pub const CLIP_CODES: Kind = Kind {
    name: "clip-codes",
    file: "a.json",
    seeds: clip_codes_seeds,
    mutate: mutate::text,
    read: clip_codes,
};

/// Made-up clips, of which a split that is not trained on has so many.
fn source(others: usize) -> Box<dyn MotionSource> {
    let section = DataSection {
        clips: Clips::Count(16),
        val_clips: others,
        test_clips: others,
        ..DataSection::default()
    };
    data::open(&section, None).expect("made up")
}

// Codes.

fn codes_seeds(place: &Path) -> Vec<Vec<u8>> {
    let path = place.join("seed");
    let scale = |n_vocab, length| Scale { n_vocab, length };
    let several = vec![scale(8, Length::Codes(2)), scale(16, Length::FramesPerCode(4))];
    let grids = [Grid::stream(16, 4), Grid { scales: several, end_token: false }];
    let seed = |grid: Grid| {
        let clip = |frames: usize| -> (Vec<u32>, usize) {
            let n = grid.n_codes(frames);
            ((0..n as u32).map(|i| i % 8).collect(), frames)
        };
        let clips = [12, 4, 8].map(clip);
        let own = || SplitTokens::new(clips.iter().map(|(codes, frames)| (&codes[..], *frames)));
        let split = own().in_groups(["a", "b", "a"].map(String::from));
        write_store(&path, &grid, &[split.clone(), split, own()]).expect("a writable folder");
        fs::read(&path).expect("just written")
    };
    grids.map(seed).to_vec()
}

fn codes(path: &Path) -> Result<(), String> {
    let store = TokenStore::open(path).map_err(words)?;
    let scales = store.grid().scales.len();
    for split in Split::ALL {
        let mut codes = 0;
        for clip in 0..store.n_clips(split) {
            codes += store.clip(split, clip).len();
            assert_eq!(store.stream(split, clip).len(), store.clip(split, clip).len());
            (0..scales).for_each(|scale| drop(store.scale(split, clip, scale).to_vec()));
            let _ = store.clip_frames(split, clip);
        }
        assert_eq!(codes, store.n_tokens(split));
        let _ = (store.n_targets(split), store.n_frames(split), store.groups(split));
    }
    if store.n_vocab() < 1 << 20 {
        let probs = store.stream_log_probs();
        assert!(probs.iter().all(|p| p.is_finite()), "{probs:?}");
        let _ = store.zero_count_targets();
    }
    Ok(())
}

fn clip_codes_seeds(place: &Path) -> Vec<Vec<u8>> {
    let path = place.join("seed");
    let scales = vec![ClipScale { n_vocab: 8, n_codes: 2 }, ClipScale { n_vocab: 16, n_codes: 3 }];
    let clip = ClipCodes {
        tokenizer_id: "a1".into(),
        motion: "walk.npy".into(),
        caption: Some("a person walks".into()),
        fps: 20.0,
        frames: 12,
        scales,
        codes: vec![7, 0, 1, 2, 15],
    };
    clip.write(&path).expect("a writable folder");
    vec![fs::read(&path).expect("just written")]
}

fn clip_codes(path: &Path) -> Result<(), String> {
    let clip = ClipCodes::read(path).map_err(words)?;
    let again = path.with_extension("again");
    clip.write(&again).map_err(words)?;
    assert_eq!(ClipCodes::read(&again).map_err(words)?, clip);
    Ok(())
}

// Vectors of captions.

const DIM: usize = 8;

fn vectors_seeds(place: &Path) -> Vec<Vec<u8>> {
    let path = place.join("seed");
    embed(&HashedNgrams::new(DIM, 6), &*source(4), &path).expect("a writable folder");
    let several = fs::read(&path).expect("just written");
    let (none, one): (&[u32], &[u64]) = (&[0], &[0, 1]);
    let mut all =
        vec![NewColumn::new("embeddings", &[0.5f32; 4]), NewColumn::new("words", &[0u64, 2])];
    for split in Split::ALL {
        all.push(NewColumn::new(format!("{}.captions", split.name()), none));
        all.push(NewColumn::new(format!("{}.offsets", split.name()), one));
    }
    columns::write(&path, &all, Some(("dim", "2".to_string()))).expect("a writable folder");
    vec![several, fs::read(&path).expect("just written")]
}

fn vectors(path: &Path) -> Result<(), String> {
    let store = TextStore::open(path).map_err(words)?;
    for split in Split::ALL {
        for clip in 0..store.n_clips(split) {
            let captions = store.captions(split, clip);
            captions.iter().for_each(|caption| {
                assert!(store.embedding(*caption).len().is_multiple_of(store.dim()));
            });
            let _ = store.shown(split, clip);
        }
    }
    Ok(())
}

const CAPTIONS: [&str; 2] = ["he sits", "she runs"];

fn embeddings_seeds(_: &Path) -> Vec<Vec<u8>> {
    let keys: Vec<u8> = CAPTIONS.iter().flat_map(|text| caption_key(text).to_le_bytes()).collect();
    let offsets: Vec<u8> = [0u64, 1, 4].iter().flat_map(|n| n.to_le_bytes()).collect();
    let numbers: Vec<u8> = (0..4 * DIM).flat_map(|i| (i as f32).to_le_bytes()).collect();
    let view = |dtype, shape: &[usize], bytes| {
        TensorView::new(dtype, shape.to_vec(), bytes).expect("sound")
    };
    let all = [
        ("keys", view(Dtype::U64, &[2], &keys)),
        ("offsets", view(Dtype::U64, &[3], &offsets)),
        ("embeddings", view(Dtype::F32, &[4, DIM], &numbers)),
    ];
    vec![serialize(all, None).expect("sound tensors")]
}

fn embeddings(path: &Path) -> Result<(), String> {
    let file = EmbeddingFile::open(path, DIM, 2).map_err(words)?;
    for caption in CAPTIONS {
        let vectors = file.encode(caption).map_err(words)?;
        assert_eq!(vectors.len(), file.n_tokens(caption).map_err(words)? * DIM);
        assert!(vectors.iter().all(|x| x.is_finite()));
    }
    Ok(())
}

// Tokenizers and evaluators: a description and weights.

fn no_progress(_: Step) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn save_tokenizer(place: &Path) {
    let source = source(4);
    let training = TokenizerTraining { steps: 1, batch: 2, ..TokenizerTraining::default() };
    let sizes = ConvolutionalSpec { width: 8, depth: 1, ..ConvolutionalSpec::default() };
    let architecture = ArchitectureSpec::Convolutional(sizes);
    let spec = TokenizerSpec { architecture, training, ..TokenizerSpec::default() };
    let corpus = Corpus::wordless(&*source);
    let tokenizer =
        train(&spec, &corpus, &Device::flex(), None, &mut no_progress).expect("made-up motion");
    tokenizer.save(place).expect("a writable folder");
}

fn save_evaluator(place: &Path) {
    let section =
        EvaluatorSection { width: Some(16), layers: Some(1), heads: Some(1), ..Default::default() };
    let small = EvaluatorSpec {
        dim: 16,
        steps: 1,
        evaluations: 1,
        batch: 4,
        pool_clips: 8,
        ..section.spec()
    };
    let trained = evaluator::train(&small, &*source(128), &Device::flex(), None, &mut no_progress);
    trained.expect("made-up motion").evaluator.save(place).expect("a writable folder");
}

/// Saves a model in a folder and gives one of its files.
fn kept(place: &Path, save: fn(&Path), file: &str) -> Vec<Vec<u8>> {
    save(place);
    vec![fs::read(place.join(file)).expect("just saved")]
}

/// A motion whose features are all alike.
fn still() -> Vec<f32> {
    vec![0.1; 64 * N_FEATURES]
}

fn tokenizer(path: &Path) -> Result<(), String> {
    let folder = path.parent().expect("a folder");
    let tokenizer = Tokenizer::load(folder, &Device::flex()).map_err(words)?;
    let codes = tokenizer.encode(&still(), None).map_err(words)?;
    assert!(codes.iter().all(|code| (*code as usize) < tokenizer.n_vocab()));
    tokenizer.decode(&codes, 64, None, 0.0).map_err(words)?;
    assert!(
        tokenizer.fps() > 0.0 && tokenizer.fps().is_finite(),
        "{} frames a second",
        tokenizer.fps()
    );
    Ok(())
}

fn evaluator(path: &Path) -> Result<(), String> {
    let folder = path.parent().expect("a folder");
    let evaluator = Evaluator::load(folder, &Device::flex()).map_err(words)?;
    let motions = evaluator.motions([&still()[..]]).map_err(words)?;
    let captions = evaluator.captions(["a person walks"]).map_err(words)?;
    assert_eq!((motions.dim(), captions.dim()), (evaluator.spec().dim, evaluator.spec().dim));
    assert!(
        evaluator.fps() > 0.0 && evaluator.fps().is_finite(),
        "{} frames a second",
        evaluator.fps()
    );
    Ok(())
}
