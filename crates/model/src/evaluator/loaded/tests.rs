//! `tests/fixtures/evaluator/make.py` makes the weights, and PyTorch's vectors of motions and captions.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use super::*;
use crate::data::{DataError, Metadata, Split};
use crate::motion::N_FEATURES;
use crate::scores::Embeddings;

/// Largest difference of a number.
const TOLERANCE: f64 = 1e-4;

const NAMES: [&str; 2] = ["guo", "mardm"];

#[derive(Deserialize)]
struct Expected {
    motions: Vec<Vec<f64>>,
    /// In the order of [`Expected::tokens`].
    captions: Vec<Vec<f64>>,
    lengths: Vec<usize>,
    /// Words with parts of speech by caption.
    tokens: BTreeMap<String, String>,
}

fn fixture(name: &str) -> PathBuf {
    let fixtures = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures/evaluator");
    PathBuf::from(fixtures).join(name)
}

fn expected(name: &str) -> Expected {
    serde_json::from_slice(&fs::read(fixture(name).join("expected.json")).unwrap()).unwrap()
}

/// A copy of the converted files.
fn copied(name: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in [SPEC, WORDS, described::WEIGHTS] {
        fs::copy(fixture(name).join(file), folder.path().join(file)).unwrap();
    }
    folder
}

/// Captions with their words and parts of speech, a clip each.
struct Told {
    texts: Vec<(String, String)>,
    metadata: Metadata,
}

fn told(texts: &[(&str, &str)], fps: f32) -> Told {
    let texts = texts.iter().map(|(text, tokens)| (text.to_string(), tokens.to_string()));
    Told { texts: texts.collect(), metadata: Metadata { fps, ..Metadata::default() } }
}

impl MotionSource for Told {
    fn n_clips(&self, _: Split) -> usize {
        self.texts.len()
    }

    fn n_frames(&self, _: Split, _: usize) -> usize {
        0
    }

    fn captions(&self, _: Split, index: usize) -> Vec<String> {
        vec![self.texts[index].0.clone()]
    }

    fn tokens(&self, _: Split, index: usize) -> Vec<String> {
        vec![self.texts[index].1.clone()]
    }

    fn features(&self, _: Split, _: usize) -> Result<Vec<f32>, DataError> {
        Ok(Vec::new())
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }
}

/// The formula of make.py.
fn motion(clip: usize, n_frames: usize) -> Vec<f32> {
    let of = |t: usize, i: usize| {
        let (t, i) = (t as f64, i as f64);
        (0.1 * (clip + 1) as f64 * t + 0.7 * i).sin() * (1.0 + i % 5.0)
    };
    (0..n_frames * N_FEATURES).map(|at| of(at / N_FEATURES, at % N_FEATURES) as f32).collect()
}

fn assert_near(found: &Embeddings, expected: &[Vec<f64>]) {
    assert_eq!(found.len(), expected.len());
    for (row, expected) in expected.iter().enumerate() {
        let off = found.row(row).iter().zip(expected).map(|(a, b)| (a - b).abs());
        let off = off.fold(0.0, f64::max);
        assert!(off < TOLERANCE, "row {row} is off by {off}: {:?} {expected:?}", found.row(row));
    }
}

fn embeds_as_expected(evaluator: &Evaluator, expected: &Expected) {
    let motions: Vec<Vec<f32>> =
        expected.lengths.iter().enumerate().map(|(clip, n)| motion(clip, *n)).collect();
    assert_near(&evaluator.motions(motions.iter().map(Vec::as_slice)).unwrap(), &expected.motions);
    // Not filled up to the longest of a batch, but always as far.
    let alone = evaluator.motions([&motions[1][..]]).unwrap();
    assert_near(&alone, &expected.motions[1..2]);
    let captions = expected.tokens.keys().map(String::as_str);
    assert_near(&evaluator.captions(captions).unwrap(), &expected.captions);
}

#[test]
fn converted_networks_give_the_vectors_of_the_public_architecture() {
    for name in NAMES {
        let expected = expected(name);
        let texts = expected.tokens.iter().map(|(text, tokens)| (&text[..], &tokens[..]));
        let source = told(&texts.collect::<Vec<_>>(), 20.0);
        let device = Device::flex();
        let evaluator = Evaluator::converted(&fixture(name), &source, &device).unwrap();
        assert_eq!(evaluator.spec().loaded.as_ref().unwrap().name, name);
        embeds_as_expected(&evaluator, &expected);
        let folder = tempfile::tempdir().unwrap();
        evaluator.save(folder.path()).unwrap();
        embeds_as_expected(&Evaluator::load(folder.path(), &device).unwrap(), &expected);
    }
}

fn refused(folder: &Path, source: &Told) -> String {
    Evaluator::converted(folder, source, &Device::flex()).unwrap_err().to_string()
}

#[test]
fn a_folder_that_holds_no_converted_evaluator_is_refused_with_the_reason() {
    let empty = tempfile::tempdir().unwrap();
    let error = refused(empty.path(), &told(&[], 20.0));
    assert!(error.contains("convert_evaluator.py made: evaluator.json: "), "{error}");
    for (from, to, says) in [
        ("\"guo\"", "\"mine\"", "`mine` is no evaluator of published tables: guo, mardm"),
        ("259", "247", "its networks see 247 features, not 259 or 67"),
        ("\"width\": 4", "\"width\": 6", "parameter Matching.movement.first.affine.weight"),
        ("\"width\": 4", "\"width\": 8000", "width of 8000 is larger than any of its weights"),
        ("\"word_dim\": 5", "\"word_dim\": 6", "words.vectors is not 14 × 6"),
    ] {
        let folder = copied("guo");
        let path = folder.path().join(SPEC);
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from));
        fs::write(&path, text.replace(from, to)).unwrap();
        let error = refused(folder.path(), &told(&[], 20.0));
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn data_at_another_rate_and_captions_without_parts_of_speech_are_refused() {
    let folder = fixture("guo");
    let error = refused(&folder, &told(&[], 30.0));
    assert!(error.contains("20 frames a second, and the data have 30"), "{error}");
    let source = told(&[("he waves", ""), ("he walks", "he/PRON walk/VERB")], 20.0);
    let evaluator = Evaluator::converted(&folder, &source, &Device::flex()).unwrap();
    assert_eq!(evaluator.captions(["he walks"]).unwrap().len(), 1);
    let error = evaluator.captions(["he waves"]).unwrap_err().to_string();
    assert!(error.contains("no text of the test split gives those of `he waves`"), "{error}");
}

#[test]
fn other_files_are_another_evaluator() {
    let [one, same] = [copied("guo"), copied("guo")];
    let digest = |folder: &Path| spec_of(folder).unwrap().loaded.unwrap().digest;
    assert_eq!(digest(one.path()), digest(same.path()));
    let path = same.path().join(WORDS);
    fs::write(&path, fs::read_to_string(&path).unwrap().replace("wave", "waive")).unwrap();
    assert_ne!(digest(one.path()), digest(same.path()));
}
