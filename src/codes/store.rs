//! [`TokenStore`]: the codes of a data set in one memory-mapped file that many processes share.
//!
//! The file is safetensors: for each split `<split>.codes` (u32, clip after clip) and
//! `<split>.offsets` (u64, where each clip starts, and the end), with `n_vocab` in its metadata.

use std::collections::HashMap;
use std::path::Path;

use crate::codes::CodeHistogram;
use crate::data::Split;
use crate::files::FileError;
use crate::files::columns::{self, Column, MappedFile, NewColumn};

/// The codes of one split.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SplitTokens {
    codes: Vec<u32>,
    /// `[n_clips + 1]`.
    offsets: Vec<u64>,
}

impl SplitTokens {
    /// Joins clips, which keep their order.
    pub fn new(clips: &[&[u32]]) -> Self {
        let mut offsets = vec![0];
        offsets.extend(clips.iter().scan(0, |end, clip| {
            *end += clip.len() as u64;
            Some(*end)
        }));
        Self { codes: clips.concat(), offsets }
    }
}

/// Writes the three splits, in [`Split::ALL`]'s order, whole, by rename.
pub fn write_store(path: &Path, n_vocab: usize, splits: &[SplitTokens]) -> Result<(), FileError> {
    let all: Vec<NewColumn> = Split::ALL
        .iter()
        .zip(splits)
        .flat_map(|(split, tokens)| {
            [
                NewColumn::new(name(*split, CODES), &tokens.codes),
                NewColumn::new(name(*split, OFFSETS), &tokens.offsets),
            ]
        })
        .collect();
    let notes = HashMap::from([(N_VOCAB.to_string(), n_vocab.to_string())]);
    columns::write(path, &all, notes)
}

const CODES: &str = "codes";
const OFFSETS: &str = "offsets";
const N_VOCAB: &str = "n_vocab";

fn name(split: Split, part: &str) -> String {
    format!("{}.{part}", split.name())
}

/// A tokenised data set, opened for reading.
#[derive(Debug)]
pub struct TokenStore {
    n_vocab: usize,
    /// In [`Split::ALL`]'s order.
    splits: [StoredSplit; 3],
}

#[derive(Debug)]
struct StoredSplit {
    codes: Column<u32>,
    offsets: Column<u64>,
}

impl TokenStore {
    /// Maps the file into memory and checks that it is whole.
    ///
    /// # Errors
    /// [`FileError::Read`] and [`FileError::Damaged`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let file = MappedFile::open(path)?;
        let n_vocab = file.number(N_VOCAB)?;
        let [train, val, test] = Split::ALL.map(|split| StoredSplit::read(&file, split, n_vocab));
        Ok(Self { n_vocab, splits: [train?, val?, test?] })
    }

    /// Codes (V).
    pub fn n_vocab(&self) -> usize {
        self.n_vocab
    }

    /// Clips of a split.
    pub fn n_clips(&self, split: Split) -> usize {
        self.split(split).offsets.values().len() - 1
    }

    /// Codes of a split, without end tokens.
    pub fn n_tokens(&self, split: Split) -> usize {
        self.codes(split).len()
    }

    /// The codes of a clip; `index` is below [`TokenStore::n_clips`].
    pub fn clip(&self, split: Split, index: usize) -> &[u32] {
        let offsets = self.split(split).offsets.values();
        &self.codes(split)[offsets[index] as usize..offsets[index + 1] as usize]
    }

    /// The codes of a split, clip after clip.
    pub fn codes(&self, split: Split) -> &[u32] {
        self.split(split).codes.values()
    }

    /// ln p_uni of each code and, last, of the end token, `[V + 1]`, in nats.
    ///
    /// p_uni(k) = (count(k) + 1) / (total + V + 1) over the training split with one end token a
    /// clip: the denominator of the normalised loss (ScaMo §4.4), smoothed because at a large V
    /// some codes of the test split are new.
    pub fn unigram_log_probs(&self) -> Vec<f64> {
        let n_clips = self.n_clips(Split::Train) as u64;
        let counts = CodeHistogram::new(self.n_vocab, self.codes(Split::Train));
        let total = (self.n_tokens(Split::Train) as u64 + n_clips + self.n_vocab as u64 + 1) as f64;
        let counts = counts.counts().iter().chain([&n_clips]);
        counts.map(|&count| ((count + 1) as f64 / total).ln()).collect()
    }

    fn split(&self, split: Split) -> &StoredSplit {
        match split {
            Split::Train => &self.splits[0],
            Split::Val => &self.splits[1],
            Split::Test => &self.splits[2],
        }
    }
}

impl StoredSplit {
    /// Both columns of a split, checked.
    fn read(file: &MappedFile, split: Split, n_vocab: usize) -> Result<Self, FileError> {
        let codes = file.column(&name(split, CODES))?;
        let split = Self { codes, offsets: file.column(&name(split, OFFSETS))? };
        if split.is_sound(n_vocab) {
            Ok(split)
        } else {
            Err(file.damaged("its codes and offsets disagree"))
        }
    }

    fn is_sound(&self, n_vocab: usize) -> bool {
        let (codes, offsets) = (self.codes.values(), self.offsets.values());
        offsets.first() == Some(&0)
            && offsets.last() == Some(&(codes.len() as u64))
            && offsets.is_sorted()
            && codes.iter().all(|&code| (code as usize) < n_vocab)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn store(n_vocab: usize, train: &[&[u32]]) -> Result<TokenStore, FileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens.safetensors");
        let splits = [SplitTokens::new(train), SplitTokens::new(&[]), SplitTokens::new(&[&[2]])];
        write_store(&path, n_vocab, &splits).unwrap();
        TokenStore::open(&path)
    }

    #[test]
    fn clips_come_back_as_they_were_written() {
        let store = store(4, &[&[0, 3, 1], &[], &[2]]).unwrap();
        let clips: Vec<_> = (0..3).map(|index| store.clip(Split::Train, index)).collect();
        assert_eq!(clips, [vec![0, 3, 1], vec![], vec![2]]);
        assert_eq!(Split::ALL.map(|split| store.n_clips(split)), [3, 0, 1]);
        assert_eq!(Split::ALL.map(|split| store.n_tokens(split)), [4, 0, 1]);
        assert_eq!(store.clip(Split::Test, 0), [2]);
    }

    #[test]
    fn unigram_probabilities_count_one_end_token_a_clip_and_sum_to_one() {
        let store = store(4, &[&[0, 0, 1], &[0]]).unwrap();
        let probs: Vec<f64> = store.unigram_log_probs().iter().map(|p| p.exp()).collect();
        let expected = [4.0, 2.0, 1.0, 1.0, 3.0].map(|count| count / 11.0);
        assert!(probs.iter().zip(expected).all(|(p, e)| (p - e).abs() < 1e-12), "{probs:?}");
        assert_eq!(probs.len(), 5);
    }

    #[test]
    fn a_code_beyond_the_codebook_is_refused() {
        let error = store(3, &[&[0, 3]]).unwrap_err().to_string();
        assert!(error.contains("tokenise again"), "{error}");
    }

    #[test]
    fn a_cut_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens.safetensors");
        let split = SplitTokens::new(&[&[1, 2, 3]]);
        write_store(&path, 4, &[split.clone(), split.clone(), split]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 4]).unwrap();
        assert!(TokenStore::open(&path).is_err());
    }
}
