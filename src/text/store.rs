//! [`TextStore`]: the captions of a data set as vectors, in one file that many processes share.
//!
//! Columns: `embeddings` (f32), `words` (u64, where each distinct caption starts, in words, and the
//! end), and for each split `<split>.captions` (u32, distinct captions, clip after clip) and
//! `<split>.offsets` (u64, where each clip's captions start, and the end); `dim` among the notes.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::encoder::TextEncoder;
use super::error::TextError;
use crate::data::{MotionSource, Split};
use crate::files::FileError;
use crate::files::columns::{self, Column, MappedFile, NewColumn};
use crate::progress::moved;

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
