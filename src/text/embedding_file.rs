//! [`EmbeddingFile`]: vectors that another program made, found by the hash of their caption.
//!
//! The file is a safetensors file of three tensors, for n captions with m vectors in all:
//!
//! | name | type | shape | what it holds |
//! | --- | --- | --- | --- |
//! | `keys` | U64 | `[n]` | the key of each caption, in any order, none twice |
//! | `offsets` | U64 | `[n + 1]` | where each caption's vectors begin, counted in vectors: 0 first, m last, at least one vector a caption |
//! | `embeddings` | F32 | `[m, dim]` | the vectors, caption after caption |
//!
//! A key is the first eight bytes of the BLAKE3 hash of the caption in UTF-8, as a little-endian
//! number. The caption is as the source gives it: lower-case, single spaces, and where clips are
//! mirrored, the mirrored caption too. Two of a million captions share a key with a chance of 3e-8.
//!
//! A caption with one vector is embedded as a sentence, one with several word by word. Vectors are
//! used as they are; those of the built-in encoder have unit mean square. Other entries of the file
//! are ignored. The file is mapped while it is read, so a new one has to take its place by rename;
//! `experiments/embed_captions.py` writes it so.

use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::encoder::TextEncoder;
use super::error::TextError;
use crate::files::FileError;
use crate::files::columns::{Column, MappedFile};

/// How a file that is not as described is mended: it is not isoflop's to make.
const ADVICE: &str = "make it again with the program that made it";

/// Vectors of captions, in a file that another program made.
#[derive(Debug)]
pub struct EmbeddingFile {
    path: PathBuf,
    file: MappedFile,
    dim: usize,
    max_tokens: usize,
    /// Where each key stands among the keys.
    places: HashMap<u64, usize>,
    offsets: Column<u64>,
    embeddings: Column<f32>,
}

impl EmbeddingFile {
    /// Maps the file and checks that it is sound and that its vectors have width `dim`; of each
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
        let file = MappedFile::open(path)?;
        let keys: Column<u64> = file.column("keys")?;
        let embeddings = file.column("embeddings")?;
        let [n_vectors, dim] = *file.shape("embeddings")? else {
            return Err(file.damaged("`embeddings` is not a matrix"));
        };
        let offsets = file.column("offsets")?;
        check_offsets(offsets.values(), keys.values().len(), n_vectors)
            .map_err(|reason| file.damaged(reason))?;
        let places = keys.values().iter().enumerate().map(|(place, key)| (*key, place));
        let places: HashMap<u64, usize> = places.collect();
        if places.len() < keys.values().len() {
            return Err(file.damaged("a caption stands in `keys` twice"));
        }
        let path = path.to_path_buf();
        Ok(Self { path, file, dim, max_tokens, places, offsets, embeddings })
    }

    /// Where a caption's vectors stand, cut to the limit.
    fn rows(&self, caption: &str) -> Result<Range<usize>, TextError> {
        let Some(&place) = self.places.get(&caption_key(caption)) else {
            let captions = vec![caption.to_string()];
            return Err(TextError::Missing { captions, file: self.path.clone() });
        };
        let [from, to] = [0, 1].map(|i| self.offsets.values()[place + i] as usize);
        Ok(from..to.min(from + self.max_tokens))
    }
}

/// Every caption has vectors, and every vector a caption.
fn check_offsets(offsets: &[u64], n_captions: usize, n_vectors: usize) -> Result<(), String> {
    let sound = offsets.len() == n_captions + 1
        && offsets.first() == Some(&0)
        && offsets.last() == Some(&(n_vectors as u64))
        && offsets.is_sorted_by(|from, to| from < to);
    let wanted = "`offsets` does not rise from 0";
    sound.then_some(()).ok_or_else(|| format!("{wanted} to {n_vectors} in {n_captions} steps"))
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
        Some(blake3::hash(self.file.bytes()).to_hex().to_string())
    }
}

/// The key of a caption in a file of embeddings.
pub fn caption_key(caption: &str) -> u64 {
    let hash = blake3::hash(caption.as_bytes());
    u64::from_le_bytes(*hash.as_bytes().first_chunk().expect("a hash has 32 bytes"))
}

#[cfg(test)]
mod tests;
