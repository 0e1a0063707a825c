//! [`TextStore`]: the captions of a data set as vectors, in one file that many processes share.
//!
//! Columns: `embeddings` (f32), `words` (u64, where each distinct caption starts, in words, and the
//! end), and for each split `<split>.captions` (u32, distinct captions, clip after clip) and
//! `<split>.offsets` (u64, where each clip's captions start, and the end); `dim` among the notes.

use crate::data::{MotionSource, Split};
use crate::failure::FailureKind;
use crate::files::columns::{Column, MappedFile, NewColumn};
use crate::files::{FileError, columns};
use crate::progress::moved;
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Captions that an encoder is given at once.
const AT_ONCE: usize = 1024;

/// Captions of one split, by clip.
struct SplitCaptions {
    captions: Vec<u32>,
    offsets: Vec<u64>,
}

/// Embeds each distinct caption of `source` once and writes the store at `path`.
///
/// # Errors
/// Captions without vectors, all in one [`TextError::Missing`]; the file cannot be written.
pub fn embed(
    encoder: &dyn TextEncoder,
    source: &dyn MotionSource,
    path: &Path,
) -> Result<(), TextError> {
    let (distinct, splits) = captions_of(source);
    let (embeddings, words) = vectors_of(encoder, &distinct)?;
    let mut all = vec![NewColumn::new("embeddings", &embeddings), NewColumn::new("words", &words)];
    for (split, found) in Split::ALL.iter().zip(&splits) {
        all.push(NewColumn::new(format!("{}.captions", split.name()), &found.captions));
        all.push(NewColumn::new(format!("{}.offsets", split.name()), &found.offsets));
    }
    let notes = HashMap::from([("dim".to_string(), encoder.dim().to_string())]);
    Ok(columns::write(path, &all, notes)?)
}

/// The distinct captions, in the order in which they first appear, and those of each split.
fn captions_of(source: &dyn MotionSource) -> (Vec<String>, [SplitCaptions; 3]) {
    let mut ids: HashMap<String, u32> = HashMap::new();
    let splits = Split::ALL.map(|split| {
        let mut found = SplitCaptions { captions: Vec::new(), offsets: vec![0] };
        for clip in 0..source.n_clips(split) {
            moved();
            for caption in source.captions(split, clip) {
                let next = ids.len() as u32;
                found.captions.push(*ids.entry(caption).or_insert(next));
            }
            found.offsets.push(found.captions.len() as u64);
        }
        found
    });
    let mut distinct = vec![String::new(); ids.len()];
    ids.into_iter().for_each(|(caption, id)| distinct[id as usize] = caption);
    (distinct, splits)
}

/// The vectors of all captions, and where each caption's begin, in words, with the end.
fn vectors_of(
    encoder: &dyn TextEncoder,
    captions: &[String],
) -> Result<(Vec<f32>, Vec<u64>), TextError> {
    let (mut embeddings, mut words) = (Vec::new(), vec![0]);
    let mut missing: Option<(Vec<String>, PathBuf)> = None;
    for several in captions.chunks(AT_ONCE) {
        for vectors in encoder.encode_all(several) {
            moved();
            match vectors {
                Err(TextError::Missing { captions, file }) => {
                    missing.get_or_insert((Vec::new(), file)).0.extend(captions);
                }
                vectors => embeddings.extend(vectors?),
            }
            words.push((embeddings.len() / encoder.dim()) as u64);
        }
    }
    match missing {
        Some((captions, file)) => Err(TextError::Missing { captions, file }),
        None => Ok((embeddings, words)),
    }
}

/// The embedded captions of a data set, opened for reading.
#[derive(Debug)]
pub struct TextStore {
    dim: usize,
    embeddings: Column<f32>,
    words: Column<u64>,
    /// Captions and offsets, in [`Split::ALL`]'s order.
    splits: Vec<(Column<u32>, Column<u64>)>,
}

impl TextStore {
    /// Maps the file into memory and checks that it is whole.
    ///
    /// # Errors
    /// [`FileError::Read`] and [`FileError::Damaged`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let file = MappedFile::open(path)?.verified()?;
        let split = |split: Split| {
            let name = split.name();
            let captions = file.column(&format!("{name}.captions"))?;
            Ok((captions, file.column(&format!("{name}.offsets"))?))
        };
        let store = Self {
            dim: file.number("dim")?,
            embeddings: file.column("embeddings")?,
            words: file.column("words")?,
            splits: Split::ALL.into_iter().map(split).collect::<Result<_, FileError>>()?,
        };
        if store.is_sound() { Ok(store) } else { Err(file.damaged("its columns disagree")) }
    }

    fn is_sound(&self) -> bool {
        let words = self.words.values();
        let n_words = self.embeddings.values().len() / self.dim;
        let split_is_sound = |(captions, offsets): &(Column<u32>, Column<u64>)| {
            let (captions, offsets) = (captions.values(), offsets.values());
            offsets.is_sorted()
                && offsets.last() == Some(&(captions.len() as u64))
                && captions.iter().all(|&id| (id as usize) + 1 < words.len())
        };
        words.is_sorted()
            && words.last() == Some(&(n_words as u64))
            && self.splits.iter().all(split_is_sound)
    }

    /// Width of a vector.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Clips of a split.
    pub fn n_clips(&self, split: Split) -> usize {
        self.splits[split as usize].1.values().len() - 1
    }

    /// Distinct captions of a clip, by id.
    pub fn captions(&self, split: Split, clip: usize) -> &[u32] {
        let (captions, offsets) = &self.splits[split as usize];
        let offsets = offsets.values();
        &captions.values()[offsets[clip] as usize..offsets[clip + 1] as usize]
    }

    /// The vectors of the caption that a clip shows where it is measured: clip i shows caption i mod n.
    pub fn shown(&self, split: Split, clip: usize) -> &[f32] {
        let captions = self.captions(split, clip);
        self.embedding(captions[clip % captions.len()])
    }

    /// The vectors of a caption, `[n_words, dim]` row-major.
    pub fn embedding(&self, caption: u32) -> &[f32] {
        let words = self.words.values();
        let [from, to] = [0, 1].map(|i| words[caption as usize + i] as usize * self.dim);
        &self.embeddings.values()[from..to]
    }
}

// [`TextEncoder`]: what turns a caption into a sequence of vectors.

/// A frozen encoder of captions.
pub trait TextEncoder: Sync {
    /// Width of a vector.
    fn dim(&self) -> usize;

    /// One vector a text token, `[n_tokens, dim]` row-major, at least one and at most the limit
    /// that the encoder was made with.
    ///
    /// # Errors
    /// The encoder has no vectors for this caption.
    fn encode(&self, caption: &str) -> Result<Vec<f32>, TextError>;

    /// How many vectors [`encode`](Self::encode) gives, without making them.
    ///
    /// # Errors
    /// As there.
    fn n_tokens(&self, caption: &str) -> Result<usize, TextError>;

    /// The same of several captions, in their order.
    fn encode_all(&self, captions: &[String]) -> Vec<Result<Vec<f32>, TextError>> {
        captions.iter().map(|caption| self.encode(caption)).collect()
    }

    /// Hex digest of what the vectors follow from beside the spec; `None` where nothing is.
    fn digest(&self) -> Option<String> {
        None
    }
}

// [`TextError`]: why captions have no vectors.

/// Captions that a message names.
const NAMED: usize = 3;

/// Why captions have no vectors.
#[derive(Debug, thiserror::Error)]
pub enum TextError {
    /// The file knows nothing of captions that the data has.
    #[error("{} has no vectors for {}; make it again from this data", file.display(), named(captions))]
    Missing { captions: Vec<String>, file: PathBuf },
    /// The file's vectors are not as wide as the models expect.
    #[error(
        "{} holds vectors of width {found}, and text.dim is {wanted}: set text.dim to {found}",
        file.display()
    )]
    Width { found: usize, wanted: usize, file: PathBuf },
    /// A model whose weights cannot be used.
    #[error("the text encoder in {} cannot be used: {reason}", folder.display())]
    Model { folder: PathBuf, reason: String },
    /// What would be made is not what the sweep was planned with.
    #[error(
        "{}, or the data, has changed since the sweep was planned; `isoflop run` plans it again",
        file.display()
    )]
    Changed { file: PathBuf },
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
}

impl TextError {
    /// The failure of a job that ends with it.
    pub fn failure_kind(&self) -> FailureKind {
        match self {
            Self::File(error) => error.failure_kind(),
            _ => FailureKind::BadData,
        }
    }
}

/// The first few captions, and how many there are.
fn named(captions: &[String]) -> String {
    let quoted: Vec<String> = captions.iter().take(NAMED).map(|c| format!("`{c}`")).collect();
    let first = quoted.join(", ");
    match captions.len() {
        1 => format!("the caption {first}"),
        n if n <= NAMED => format!("{n} captions: {first}"),
        n => format!("{n} captions, among them {first}"),
    }
}

// [`EmbeddingFile`]: vectors that another program made, found by the hash of their caption.
//
// The file is a safetensors file of three tensors, for n captions with m vectors in all:
//
// | name | type | shape | what it holds |
// | --- | --- | --- | --- |
// | `keys` | U64 | `[n]` | the key of each caption, in any order, none twice |
// | `offsets` | U64 | `[n + 1]` | where each caption's vectors begin, counted in vectors: 0 first, m last, at least one vector a caption |
// | `embeddings` | F32 | `[m, dim]` | the vectors, caption after caption |
//
// A key is the first eight bytes of the BLAKE3 hash of the caption in UTF-8, as a little-endian
// number. The caption is as the source gives it: lower-case, single spaces, and where clips are
// mirrored, the mirrored caption too. Two of a million captions share a key with a chance of 3e-8.
//
// A caption with one vector is embedded as a sentence, one with several word by word. Vectors are
// used as they are; those of the built-in encoder have unit mean square. Other entries of the file
// are ignored. The file is mapped while it is read, so a new one has to take its place by rename;
// `experiments/embed_captions.py` writes it so.

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
