//! Tests of the module above.

use super::*;
use crate::failure::FailureKind;
use safetensors::tensor::{Dtype, TensorView, serialize};
use std::fs;
use tempfile::TempDir;

fn missing(n: usize) -> String {
    let captions = (0..n).map(|i| format!("he sits {i}")).collect();
    TextError::Missing { captions, file: "a/b".into() }.to_string()
}

#[test]
fn missing_captions_are_counted_and_the_first_are_named() {
    assert!(missing(1).starts_with("a/b has no vectors for the caption `he sits 0`;"));
    assert!(missing(2).contains("for 2 captions: `he sits 0`, `he sits 1`;"));
    assert!(missing(9).contains("for 9 captions, among them `he sits 0`, `he sits 1`, `he"));
    assert!(!missing(9).contains("he sits 3"));
}

#[test]
fn what_is_wrong_with_the_data_is_told_from_what_is_wrong_with_a_file() {
    let width = TextError::Width { found: 384, wanted: 64, file: "a".into() };
    assert_eq!(width.failure_kind(), FailureKind::BadData);
    let full = FileError::write("a".as_ref())(std::io::Error::from_raw_os_error(28));
    assert_eq!(TextError::from(full).failure_kind(), FailureKind::DiskFull);
}

/// A file of vectors of width 2: one for "he sits", three for "she runs".
struct Sample {
    keys: Vec<u64>,
    offsets: Vec<u64>,
    embeddings: Vec<f32>,
    shape: Vec<usize>,
}

impl Default for Sample {
    fn default() -> Self {
        Self {
            keys: ["he sits", "she runs"].map(caption_key).to_vec(),
            offsets: vec![0, 1, 4],
            embeddings: (0..8).map(|i| i as f32).collect(),
            shape: vec![4, 2],
        }
    }
}

impl Sample {
    fn write(&self, folder: &TempDir) -> PathBuf {
        let path = folder.path().join("captions.safetensors");
        let list = |values| (Dtype::U64, vec![<[u64]>::len(values)], bytemuck::cast_slice(values));
        let matrix = (Dtype::F32, self.shape.clone(), bytemuck::cast_slice(&self.embeddings));
        let tensors =
            [("keys", list(&self.keys)), ("offsets", list(&self.offsets)), ("embeddings", matrix)];
        let views = tensors
            .map(|(name, (dtype, shape, bytes))| (name, TensorView::new(dtype, shape, bytes)))
            .map(|(name, view)| (name, view.expect("shape and length agree")));
        fs::write(&path, serialize(views, None).expect("sound tensors")).expect("a folder");
        path
    }

    fn open(&self, dim: usize, max_tokens: usize) -> Result<EmbeddingFile, TextError> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        EmbeddingFile::open(&self.write(&folder), dim, max_tokens)
    }

    fn problem(&self) -> String {
        let error = self.open(2, 9).expect_err("the file is damaged");
        assert_eq!(error.failure_kind(), FailureKind::Damaged);
        let text = error.to_string();
        assert!(text.contains("; make it again with the program that made it"), "{text}");
        text
    }
}

#[test]
fn a_caption_that_is_in_the_file_has_its_vectors_up_to_the_limit() {
    let file = Sample::default().open(2, 2).expect("a sound file");
    assert_eq!(file.encode("he sits").expect("it is there"), [0.0, 1.0]);
    assert_eq!(file.encode("she runs").expect("it is there"), [2.0, 3.0, 4.0, 5.0]);
    let file = Sample::default().open(2, 9).expect("a sound file");
    assert_eq!(file.encode("she runs").expect("it is there").len(), 6);
}

#[test]
fn a_caption_that_is_not_in_the_file_is_named() {
    let file = Sample::default().open(2, 2).expect("a sound file");
    let error = file.encode("he stands").expect_err("it is not there");
    assert!(error.to_string().contains("no vectors for the caption `he stands`"), "{error}");
    assert_eq!(error.failure_kind(), FailureKind::BadData);
}

#[test]
fn another_width_than_the_sweep_asks_for_is_an_error_with_both() {
    let error = Sample::default().open(64, 2).expect_err("the file's vectors have width 2");
    let text = error.to_string();
    assert!(text.contains("vectors of width 2, and text.dim is 64: set text.dim to 2"), "{text}");
    assert_eq!(error.failure_kind(), FailureKind::BadData);
}

#[test]
fn a_file_that_is_not_as_described_says_what_is_wrong() {
    let sample = Sample::default;
    for offsets in [vec![0, 1], vec![0, 1, 3], vec![1, 2, 4], vec![0, 4, 4], vec![0, 5, 4]] {
        let problem = Sample { offsets, ..sample() }.problem();
        assert!(problem.contains("`offsets` does not rise from 0 to 4 in 2 steps"), "{problem}");
    }
    let problem = Sample { keys: vec![7, 7], ..sample() }.problem();
    assert!(problem.contains("a caption stands in `keys` twice"), "{problem}");
    let problem = Sample { shape: vec![8], ..sample() }.problem();
    assert!(problem.contains("`embeddings` is not a matrix"), "{problem}");
}

#[test]
fn a_file_that_is_cut_or_gone_is_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = Sample::default().write(&folder);
    let bytes = fs::read(&path).expect("just written");
    fs::write(&path, &bytes[..bytes.len() - 1]).expect("a folder");
    let cut = EmbeddingFile::open(&path, 2, 9).expect_err("its last byte is gone").to_string();
    assert!(cut.contains("captions.safetensors is damaged") && cut.contains(ADVICE), "{cut}");
    fs::remove_file(&path).expect("a folder");
    let gone = EmbeddingFile::open(&path, 2, 9).expect_err("all of it is gone").to_string();
    assert!(gone.contains("cannot read") && gone.contains("captions.safetensors"), "{gone}");
}

#[test]
fn vectors_that_are_no_numbers_are_refused_with_their_caption() {
    let mut sample = Sample::default();
    sample.embeddings[0] = f32::NAN;
    let file = sample.open(2, 9).expect("nobody has looked at the vectors yet");
    let error = file.encode("he sits").expect_err("its first number is none").to_string();
    assert!(error.contains("the vectors of `he sits` hold NaN or infinity"), "{error}");
    assert!(file.encode("she runs").is_ok());
}

#[test]
fn a_digest_is_that_of_the_content() {
    let digest = |sample: Sample| sample.open(2, 9).expect("a sound file").digest();
    let found = digest(Sample::default());
    assert_eq!(found, digest(Sample::default()), "in another folder");
    let other =
        Sample { keys: ["he sits", "he runs"].map(caption_key).to_vec(), ..Sample::default() };
    assert_ne!(found, digest(other));
}

#[test]
fn keys_are_those_that_python_makes() {
    // int.from_bytes(blake3("he sits".encode()).digest()[:8], "little")
    assert_eq!(caption_key("he sits"), 0xc389_3efa_c8aa_aeaf);
}
