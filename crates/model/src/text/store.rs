//! [`TextStore`]: the captions of a data set as vectors, in one file shared by many processes; and the trait that
//! encodes captions, [`TextEncoder`].
//!
//! Columns: `embeddings` (f32), `words` (u64, the start of each distinct caption, in words, and the end), and for each
//! split `<split>.captions` (u32, distinct captions, clip by clip) and `<split>.offsets` (u64, the start of each clip's
//! captions, and the end); `training_words` (u64, sorted, a hash of each word of the captions of the training split;
//! files of older versions have none); the [`LengthEstimator`], if there are training clips
//! (files of older versions have none); `dim` in the metadata.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use crate::data::{MotionSource, Split};
use crate::failure::FailureKind;
use crate::files::FileError;
use crate::files::columns::{self, Column, ColumnFile, NewColumn};
use crate::progress::moved;

use super::lengths::{ClipCaptions, LengthEstimator};

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

    /// The number of vectors of [`encode`](Self::encode), without computing them.
    ///
    /// # Errors
    /// As there.
    fn n_tokens(&self, caption: &str) -> Result<usize, TextError>;

    /// The same for several captions, in order.
    fn encode_all(&self, captions: &[String]) -> Vec<Result<Vec<f32>, TextError>> {
        captions.iter().map(|caption| self.encode(caption)).collect()
    }

    /// Hex digest of the inputs of the vectors other than the spec; `None` if there are none.
    fn digest(&self) -> Option<String> {
        None
    }

    /// Whether what the vectors follow from is still what it was when the digest was taken.
    ///
    /// # Errors
    /// [`FileError::Changed`].
    fn unchanged(&self) -> Result<(), FileError> {
        Ok(())
    }
}

/// Captions that a message names.
const NAMED: usize = 3;

/// Why captions have no vectors.
#[derive(Debug, thiserror::Error)]
pub enum TextError {
    /// The file lacks captions of the data.
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
    /// The vectors would differ from those that the sweep was planned with.
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

// The captions of a data set.

/// Captions that an encoder is given at once.
const AT_ONCE: usize = 1024;

/// Embeds each distinct caption of `source` once, trains a length estimator, and writes the store at `path`.
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
    encoder.unchanged()?;
    let (captions, offsets) = &splits[Split::Train as usize];
    // Without long clips, which generators do not see.
    let offsets = &offsets[..=source.n_clips(Split::Train)];
    let captions = &captions[..offsets[offsets.len() - 1] as usize];
    let shown = captions.iter().map(|&id| &distinct[id as usize]);
    let known: BTreeSet<u64> = shown.flat_map(|caption| words_of(caption)).map(hash).collect();
    let known = Vec::from_iter(known);
    let mut all = vec![
        NewColumn::new("embeddings", &embeddings),
        NewColumn::new("words", &words),
        NewColumn::new(TRAINING_WORDS, &known),
    ];
    for (split, (captions, offsets)) in Split::ALL.iter().zip(&splits) {
        all.push(NewColumn::new(format!("{}.captions", split.name()), captions));
        all.push(NewColumn::new(format!("{}.offsets", split.name()), offsets));
    }
    let lengths = length_estimator(source, (captions, offsets), &embeddings, &words);
    if let Some(lengths) = &lengths {
        all.extend(lengths.columns());
    }
    Ok(columns::write(path, &all, Some(("dim", encoder.dim().to_string())))?)
}

/// A length estimator trained on the captions of the training split; `None` without clips.
fn length_estimator(
    source: &dyn MotionSource,
    (captions, offsets): (&[u32], &[u64]),
    embeddings: &[f32],
    words: &[u64],
) -> Option<LengthEstimator> {
    let clip = |(index, ends): (usize, &[u64])| {
        (source.n_frames(Split::Train, index), &captions[ends[0] as usize..ends[1] as usize])
    };
    let clips: Vec<ClipCaptions> = offsets.windows(2).enumerate().map(clip).collect();
    let dim = embeddings.len() / *words.last()? as usize;
    let vectors = |caption: u32| {
        let [from, to] = [0, 1].map(|i| words[caption as usize + i] as usize * dim);
        &embeddings[from..to]
    };
    (!clips.is_empty()).then(|| LengthEstimator::train(dim, &clips, vectors))
}

// Words of captions, in lower case.

const TRAINING_WORDS: &str = "training_words";

fn words_of(caption: &str) -> impl Iterator<Item = String> {
    let words = caption.split(|c: char| !c.is_alphanumeric() && c != '\'');
    words.filter(|word| !word.is_empty()).map(str::to_lowercase)
}

/// Of a word, the first 64 bits of its blake3 hash.
fn hash(word: impl AsRef<str>) -> u64 {
    let hash = blake3::hash(word.as_ref().as_bytes());
    u64::from_le_bytes(*hash.as_bytes().first_chunk().expect("32 bytes"))
}

/// The words of captions that stand in no training caption of the file of [`embed`] at `path`, each once; `None` if an
/// older version wrote the file.
///
/// # Errors
/// [`FileError::Read`] and [`FileError::Damaged`].
pub fn unseen_words(path: &Path, captions: &[String]) -> Result<Option<Vec<String>>, FileError> {
    let Ok(known) = ColumnFile::open(path)?.column::<u64>(TRAINING_WORDS) else { return Ok(None) };
    let mut unseen = Vec::new();
    for word in captions.iter().flat_map(|caption| words_of(caption)) {
        if known.values().binary_search(&hash(&word)).is_err() && !unseen.contains(&word) {
            unseen.push(word);
        }
    }
    Ok(Some(unseen))
}

/// Captions of a split, clip by clip, long ones last, and the start of each clip's, with the end.
type SplitCaptions = (Vec<u32>, Vec<u64>);

/// The distinct captions in order of first occurrence, and the captions of each split.
fn captions_of(source: &dyn MotionSource) -> (Vec<String>, [SplitCaptions; 3]) {
    let mut ids: HashMap<String, u32> = HashMap::new();
    let splits = Split::ALL.map(|split| {
        let (mut captions, mut offsets) = (Vec::new(), vec![0]);
        let long = if split == Split::Train { source.n_long() } else { 0 };
        for clip in 0..source.n_clips(split) + long {
            moved();
            for caption in source.captions(split, clip) {
                let next = ids.len() as u32;
                captions.push(*ids.entry(caption).or_insert(next));
            }
            offsets.push(captions.len() as u64);
        }
        (captions, offsets)
    });
    let mut distinct = vec![String::new(); ids.len()];
    ids.into_iter().for_each(|(caption, id)| distinct[id as usize] = caption);
    (distinct, splits)
}

/// The vectors of all captions, and the start of each caption's, in words, with the end.
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
    file: ColumnFile,
    dim: usize,
    embeddings: Column<f32>,
    words: Column<u64>,
    /// Captions and offsets, in [`Split::ALL`]'s order.
    splits: Vec<(Column<u32>, Column<u64>)>,
}

impl TextStore {
    /// Opens the file and checks that it is whole.
    ///
    /// # Errors
    /// [`FileError::Read`] and [`FileError::Damaged`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let file = ColumnFile::open(path)?.verified()?;
        let split = |split: Split| {
            let name = split.name();
            let captions = file.column(&format!("{name}.captions"))?;
            Ok((captions, file.column(&format!("{name}.offsets"))?))
        };
        let dim = file.number("dim")?;
        if dim == 0 {
            return Err(file.damaged("its vectors have no numbers"));
        }
        let store = Self {
            dim,
            embeddings: file.column("embeddings")?,
            words: file.column("words")?,
            splits: Split::ALL.into_iter().map(split).collect::<Result<_, FileError>>()?,
            file,
        };
        if store.is_sound() { Ok(store) } else { Err(store.file.damaged("its columns disagree")) }
    }

    /// Whether the vectors are still those that were opened.
    ///
    /// # Errors
    /// [`FileError::Changed`].
    pub fn unchanged(&self) -> Result<(), FileError> {
        self.file.unchanged()
    }

    fn is_sound(&self) -> bool {
        let words = self.words.values();
        let n_words = self.embeddings.values().len() / self.dim;
        let split_is_sound = |(captions, offsets): &(Column<u32>, Column<u64>)| {
            let (captions, offsets) = (captions.values(), offsets.values());
            // Each clip has a caption.
            offsets.is_sorted_by(|from, to| from < to)
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

    /// The caption that a clip shows where it is measured and tokenised, by id: clip i shows caption i mod n.
    pub fn shown_id(&self, split: Split, clip: usize) -> u32 {
        let captions = self.captions(split, clip);
        captions[clip % captions.len()]
    }

    /// The vectors of that caption.
    pub fn shown(&self, split: Split, clip: usize) -> &[f32] {
        self.embedding(self.shown_id(split, clip))
    }

    /// The vectors of a caption, `[n_words, dim]` row-major.
    pub fn embedding(&self, caption: u32) -> &[f32] {
        let words = self.words.values();
        let [from, to] = [0, 1].map(|i| words[caption as usize + i] as usize * self.dim);
        &self.embeddings.values()[from..to]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Procedural, ProceduralOptions};
    use crate::text::HashedNgrams;

    fn missing(n: usize) -> String {
        let captions = (0..n).map(|i| format!("he sits {i}")).collect();
        TextError::Missing { captions, file: "a/b".into() }.to_string()
    }

    #[test]
    fn words_that_no_training_caption_has_are_named_once() {
        let sizes = ProceduralOptions { seed: 0, train_clips: 3, val_clips: 1, test_clips: 1 };
        let source = Procedural::new(sizes);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("vectors.safetensors");
        embed(&HashedNgrams::new(4, 9), &source, &path).unwrap();
        let unseen = |captions: &[String]| unseen_words(&path, captions).unwrap();
        let shown = source.captions(Split::Train, 1).join(", ").to_uppercase();
        assert_eq!(unseen(std::slice::from_ref(&shown)), Some(vec![]));
        let others = [format!("{shown} Cartwheel"), "cartwheel; a lasso's".to_string()];
        let found = unseen(&others).unwrap();
        assert_eq!(found.iter().filter(|word| *word == "cartwheel").count(), 1, "{found:?}");
        assert_eq!(found[0], "cartwheel");
        assert!(found.contains(&"lasso's".to_string()));
        columns::write(&path, &[NewColumn::new("words", &[0u64])], None).unwrap();
        assert_eq!(unseen(&others), None);
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
}
