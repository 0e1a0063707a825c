//! Text encoders with weights, against what transformers makes of the same captions.
//!
//! `tests/fixtures/encoders/make.py` drew the small models and wrote the vectors. The real MiniLM is tried
//! where `ISOFLOP_MINILM` names its folder.

#![cfg(feature = "encoders")]

use std::path::{Path, PathBuf};

use isoflop::learn::weights::{self, Weights};
use isoflop::spec::{TextEncoderKind, TextSpec, TextStates};
use isoflop::text::{TextEncoder, TextError, encoder};

const CAPTIONS: [&str; 4] = [
    "a person walks",
    "someone waves with the left hand",
    "jumps",
    "a person turns and walks back",
];

const KINDS: [(&str, TextEncoderKind); 4] = [
    ("bert", TextEncoderKind::Bert),
    ("clip", TextEncoderKind::Clip),
    ("llama", TextEncoderKind::Llama),
    ("t5", TextEncoderKind::T5),
];

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/encoders")
}

fn spec(path: PathBuf, kind: TextEncoderKind, states: TextStates, dim: usize) -> TextSpec {
    TextSpec { encoder: kind, path: Some(path), states, dim, max_tokens: 32 }
}

/// The largest difference of all captions' vectors from the expected ones, as a share of the largest.
fn off(encoder: &dyn TextEncoder, expected: &Weights, states: &str) -> f64 {
    let captions = CAPTIONS.map(String::from);
    let mut worst = 0f64;
    for (index, found) in encoder.encode_all(&captions).into_iter().enumerate() {
        let (found, expected) = (found.unwrap(), &expected[&format!("{index}.{states}")].values);
        assert_eq!(found.len(), expected.len(), "caption {index}");
        let largest = expected.iter().fold(0f32, |most, x| most.max(x.abs()));
        for (a, b) in found.iter().zip(expected) {
            worst = worst.max(f64::from((a - b).abs() / largest));
        }
        assert_eq!(encoder.encode(CAPTIONS[index]).unwrap().len(), found.len());
    }
    worst
}

#[test]
fn every_kind_gives_the_states_of_the_reference() {
    for (name, kind) in KINDS {
        let folder = fixtures().join(name);
        let (expected, _) = weights::load(&folder.join("expected.safetensors")).unwrap();
        for (states, word) in [(TextStates::Words, "words"), (TextStates::Sentence, "sentence")] {
            let projected = kind == TextEncoderKind::Clip && states == TextStates::Sentence;
            let dim = if projected { 12 } else { 16 };
            let own = encoder(&spec(folder.clone(), kind, states, dim)).unwrap();
            let off = off(&*own, &expected, word);
            assert!(off < 1e-4, "{name} {word}: {off}");
        }
    }
}

#[test]
fn minilm_gives_the_states_of_the_reference() {
    let Some(folder) = std::env::var_os("ISOFLOP_MINILM") else {
        eprintln!("skipped: ISOFLOP_MINILM names no folder of all-MiniLM-L6-v2");
        return;
    };
    let (expected, _) = weights::load(&fixtures().join("minilm.safetensors")).unwrap();
    let own = spec(folder.into(), TextEncoderKind::Bert, TextStates::Words, 384);
    let off = off(&*encoder(&own).unwrap(), &expected, "words");
    assert!(off < 1e-4, "{off}");
}

#[test]
fn long_captions_are_cut_and_digests_follow_the_files() {
    let folder = fixtures().join("bert");
    let of = |max_tokens: usize| {
        let own = spec(folder.clone(), TextEncoderKind::Bert, TextStates::Words, 16);
        encoder(&TextSpec { max_tokens, ..own }).unwrap()
    };
    assert_eq!(of(32).encode(CAPTIONS[3]).unwrap().len(), 8 * 16);
    assert_eq!(of(5).encode(CAPTIONS[3]).unwrap().len(), 5 * 16);
    let other = spec(fixtures().join("t5"), TextEncoderKind::T5, TextStates::Words, 16);
    assert_eq!(of(32).digest(), of(5).digest());
    assert_ne!(of(5).digest(), encoder(&other).unwrap().digest());
}

#[test]
fn what_is_no_such_model_is_refused_with_the_reason() {
    let refused = |folder: &Path, kind, states, dim| -> TextError {
        encoder(&spec(folder.to_path_buf(), kind, states, dim)).err().expect("refused")
    };
    let bert = fixtures().join("bert");
    let words = TextStates::Words;
    let width = refused(&bert, TextEncoderKind::Bert, words, 64).to_string();
    assert!(
        width.contains("vectors of width 16, and text.dim is 64: set text.dim to 16"),
        "{width}"
    );
    let missing = refused(&fixtures(), TextEncoderKind::Bert, words, 16).to_string();
    assert!(missing.contains("config.json"), "{missing}");
    let other = refused(&bert, TextEncoderKind::T5, words, 16).to_string();
    assert!(other.contains("cannot be used: config.json: "), "{other}");
    let place = tempfile::tempdir().unwrap();
    for file in ["config.json", "tokenizer.json", "model.safetensors"] {
        std::fs::copy(bert.join(file), place.path().join(file)).unwrap();
    }
    std::fs::write(place.path().join("model.safetensors"), b"no weights").unwrap();
    let damaged = refused(place.path(), TextEncoderKind::Bert, words, 16).to_string();
    assert!(damaged.contains("cannot be used: model.safetensors"), "{damaged}");
    std::fs::write(place.path().join("tokenizer.json"), b"{}").unwrap();
    std::fs::copy(bert.join("model.safetensors"), place.path().join("model.safetensors")).unwrap();
    let unread = refused(place.path(), TextEncoderKind::Bert, words, 16).to_string();
    assert!(unread.contains("cannot be used: tokenizer.json"), "{unread}");
}
