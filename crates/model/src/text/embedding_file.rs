//! [`EmbeddingFile`]: caption vectors from another program, found by the hash of the caption.
//!
//! The file is a safetensors file of three tensors, for n captions with m vectors in all:
//!
//! | name | type | shape | content |
//! | --- | --- | --- | --- |
//! | `keys` | U64 | `[n]` | the key of each caption, in any order, none twice |
//! | `offsets` | U64 | `[n + 1]` | the start of each caption's vectors, counted in vectors: 0 first, m last, at least one per caption |
//! | `embeddings` | F32 | `[m, dim]` | the vectors, caption after caption |
//!
//! A key is the first eight bytes of the BLAKE3 hash of the caption in UTF-8, as a little-endian
//! number. The caption is as the source gives it: lower-case, single spaces, and where clips are
//! mirrored, the mirrored caption too. Two of a million captions share a key with a chance of 3e-8.
//!
//! A caption with one vector is embedded as a sentence, one with several word by word. Vectors are
//! used as they are; those of the built-in encoder have unit mean square. Other entries of the file
//! are ignored. A large file is mapped while it is used, so a new one has to take its place by rename;
//! `experiments/embed_captions.py` writes it so.

use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::store::{TextEncoder, TextError};
use crate::files::FileError;
use crate::files::columns::{Column, ColumnFile};

/// How a file that is not as described is mended: it is not isoflop's to make.
const ADVICE: &str = "make it again with the program that made it";

/// Vectors of captions, in a file that another program made.
#[derive(Debug)]
pub struct EmbeddingFile {
    path: PathBuf,
    file: ColumnFile,
    dim: usize,
    max_tokens: usize,
    /// The index of each key.
    places: HashMap<u64, usize>,
    offsets: Column<u64>,
    embeddings: Column<f32>,
    digest: OnceLock<String>,
}

impl EmbeddingFile {
    /// Opens the file and checks that it is sound and that its vectors have width `dim`; of each
    /// caption it gives the first `max_tokens` vectors. Both are at least 1.
    ///
    /// # Errors
    /// [`TextError::File`] and [`TextError::Width`].
    pub fn open(path: &Path, dim: usize, max_tokens: usize) -> Result<Self, TextError> {
        assert!(dim > 0 && max_tokens > 0, "checked when the sweep was read");
        let opened = Self::map(path, max_tokens).map_err(|error| error.with_advice(ADVICE))?;
        match opened.dim {
            found if found == dim => Ok(opened),
            found => Err(TextError::Width { found, wanted: dim, file: opened.path }),
        }
    }

    fn map(path: &Path, max_tokens: usize) -> Result<Self, FileError> {
        let file = ColumnFile::open(path)?;
        let keys: Column<u64> = file.column("keys")?;
        let embeddings = file.column("embeddings")?;
        let [n_vectors, dim] = *file.shape("embeddings")? else {
            return Err(file.damaged("`embeddings` is not a matrix"));
        };
        let offsets = file.column("offsets")?;
        let n = keys.values().len();
        if !every_caption_has_vectors(offsets.values(), n, n_vectors) {
            let wanted = format!("to {n_vectors} in {n} steps");
            return Err(file.damaged(format!("`offsets` does not rise from 0 {wanted}")));
        }
        let places = keys.values().iter().enumerate().map(|(place, key)| (*key, place));
        let places: HashMap<u64, usize> = places.collect();
        if places.len() < n {
            return Err(file.damaged("a caption stands in `keys` twice"));
        }
        let path = path.to_path_buf();
        let digest = OnceLock::new();
        Ok(Self { path, file, dim, max_tokens, places, offsets, embeddings, digest })
    }

    fn digest_now(&self) -> String {
        blake3::hash(self.file.bytes()).to_hex().to_string()
    }

    /// The range of a caption's vectors, cut to the limit.
    fn rows(&self, caption: &str) -> Result<Range<usize>, TextError> {
        let Some(&place) = self.places.get(&caption_key(caption)) else {
            let captions = vec![caption.to_string()];
            return Err(TextError::Missing { captions, file: self.path.clone() });
        };
        let [from, to] = [0, 1].map(|i| self.offsets.values()[place + i] as usize);
        Ok(from..to.min(from + self.max_tokens))
    }
}

/// Every vector has a caption, too.
fn every_caption_has_vectors(offsets: &[u64], n_captions: usize, n_vectors: usize) -> bool {
    offsets.len() == n_captions + 1
        && offsets.first() == Some(&0)
        && offsets.last() == Some(&(n_vectors as u64))
        && offsets.is_sorted_by(|from, to| from < to)
}

impl TextEncoder for EmbeddingFile {
    fn dim(&self) -> usize {
        self.dim
    }

    fn encode(&self, caption: &str) -> Result<Vec<f32>, TextError> {
        let own = self.rows(caption)?;
        let vectors = &self.embeddings.values()[own.start * self.dim..own.end * self.dim];
        if vectors.iter().all(|x| x.is_finite()) {
            return Ok(vectors.to_vec());
        }
        let reason = format!("the vectors of `{caption}` hold NaN or infinity");
        Err(self.file.damaged(reason).with_advice(ADVICE).into())
    }

    fn n_tokens(&self, caption: &str) -> Result<usize, TextError> {
        Ok(self.rows(caption)?.len())
    }

    fn digest(&self) -> Option<String> {
        Some(self.digest.get_or_init(|| self.digest_now()).clone())
    }

    fn unchanged(&self) -> Result<(), FileError> {
        self.file.unchanged()?;
        match self.digest.get() {
            Some(digest) if *digest != self.digest_now() => {
                Err(FileError::Changed { path: self.path.clone() })
            }
            _ => Ok(()),
        }
    }
}

/// The key of a caption in a file of embeddings.
pub fn caption_key(caption: &str) -> u64 {
    let hash = blake3::hash(caption.as_bytes());
    u64::from_le_bytes(*hash.as_bytes().first_chunk().expect("a hash has 32 bytes"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failure::FailureKind;
    use safetensors::tensor::{Dtype, TensorView, serialize};
    use std::fs;
    use tempfile::TempDir;

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
            let list =
                |values| (Dtype::U64, vec![<[u64]>::len(values)], bytemuck::cast_slice(values));
            let matrix = (Dtype::F32, self.shape.clone(), bytemuck::cast_slice(&self.embeddings));
            let tensors = [
                ("keys", list(&self.keys)),
                ("offsets", list(&self.offsets)),
                ("embeddings", matrix),
            ];
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
        assert!(
            text.contains("vectors of width 2, and text.dim is 64: set text.dim to 2"),
            "{text}"
        );
        assert_eq!(error.failure_kind(), FailureKind::BadData);
    }

    #[test]
    fn a_file_that_is_not_as_described_says_what_is_wrong() {
        let sample = Sample::default;
        for offsets in [vec![0, 1], vec![0, 1, 3], vec![1, 2, 4], vec![0, 4, 4], vec![0, 5, 4]] {
            let problem = Sample { offsets, ..sample() }.problem();
            assert!(
                problem.contains("`offsets` does not rise from 0 to 4 in 2 steps"),
                "{problem}"
            );
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
}
