//! [`TokenStore`]: the codes of a data set in one file that many processes read.
//!
//! The file is safetensors: for each split `<split>.codes` (u32, clip by clip, within a clip scale by scale),
//! `<split>.offsets` (u64, the start of each clip, and the end) and `<split>.frames` (u64, the frames of each clip
//! covered by its codes), with the [`Grid`] as JSON in its metadata; `<split>.groups` (u32, clips with one number were
//! recorded together) if known.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use super::{CodeHistogram, Grid};
use crate::data::Split;
use crate::files::FileError;
use crate::files::columns::{self, Column, ColumnFile, NewColumn};
use crate::spec::Share;

/// The codes of one split.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SplitTokens {
    codes: Vec<u32>,
    /// `[n_clips + 1]`.
    offsets: Vec<u64>,
    /// `[n_clips]`.
    frames: Vec<u64>,
    /// `[n_clips]`; empty if it is not known which clips were recorded together.
    groups: Vec<u32>,
}

impl SplitTokens {
    /// Joins clips, each with the frames covered by its codes, in order.
    pub fn new<'a>(clips: impl IntoIterator<Item = (&'a [u32], usize)>) -> Self {
        let mut split = Self { offsets: vec![0], ..Self::default() };
        for (codes, frames) in clips {
            split.codes.extend(codes);
            split.offsets.push(split.codes.len() as u64);
            split.frames.push(frames as u64);
        }
        split
    }

    /// With the group of each clip, a number for each name.
    pub fn in_groups(self, names: impl IntoIterator<Item = String>) -> Self {
        let mut numbers: HashMap<String, u32> = HashMap::new();
        let mut number = |name: String| {
            let next = numbers.len() as u32;
            *numbers.entry(name).or_insert(next)
        };
        Self { groups: names.into_iter().map(&mut number).collect(), ..self }
    }
}

/// Writes the three splits, in [`Split::ALL`]'s order, whole, by rename.
///
/// # Errors
/// [`FileError::Write`].
pub fn write_store(path: &Path, codes: &Grid, splits: &[SplitTokens]) -> Result<(), FileError> {
    let all: Vec<NewColumn> = Split::ALL.iter().zip(splits).flat_map(columns_of).collect();
    let grid = serde_json::to_string(codes).expect("plain values");
    columns::write(path, &all, Some((GRID, grid)))
}

fn columns_of<'a>((&split, tokens): (&Split, &'a SplitTokens)) -> Vec<NewColumn<'a>> {
    let mut columns = vec![
        NewColumn::new(name(split, CODES), &tokens.codes),
        NewColumn::new(name(split, OFFSETS), &tokens.offsets),
        NewColumn::new(name(split, FRAMES), &tokens.frames),
    ];
    if !tokens.groups.is_empty() {
        columns.push(NewColumn::new(name(split, GROUPS), &tokens.groups));
    }
    columns
}

const CODES: &str = "codes";
const OFFSETS: &str = "offsets";
const FRAMES: &str = "frames";
const GROUPS: &str = "groups";
const GRID: &str = "grid";

fn name(split: Split, part: &str) -> String {
    format!("{}.{part}", split.name())
}

/// A tokenised data set, opened for reading.
#[derive(Debug)]
pub struct TokenStore {
    file: ColumnFile,
    grid: Grid,
    /// In [`Split::ALL`]'s order.
    splits: [StoredSplit; 3],
}

#[derive(Debug)]
struct StoredSplit {
    codes: Column<u32>,
    offsets: Column<u64>,
    frames: Column<u64>,
    groups: Option<Column<u32>>,
}

impl TokenStore {
    /// Opens the file and checks that it is whole.
    ///
    /// # Errors
    /// [`FileError::Read`] and [`FileError::Damaged`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let file = ColumnFile::open(path)?.verified()?;
        let grid = file.note(GRID).and_then(|text| serde_json::from_str(text).ok());
        let grid: Grid = grid.ok_or_else(|| file.damaged("the grid of its codes is missing"))?;
        if grid.scales.is_empty() || grid.scales.iter().any(|scale| !scale.is_sound()) {
            return Err(file.damaged("the grid of its codes has a scale without codes"));
        }
        let [train, val, test] = Split::ALL.map(|split| StoredSplit::read(&file, split, &grid));
        Ok(Self { splits: [train?, val?, test?], grid, file })
    }

    /// Whether the codes are still those that were opened.
    ///
    /// # Errors
    /// [`FileError::Changed`].
    pub fn unchanged(&self) -> Result<(), FileError> {
        self.file.unchanged()
    }

    /// The grid of the codes.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Codes (V).
    pub fn n_vocab(&self) -> usize {
        self.grid.n_vocab()
    }

    /// The targets of a split: its codes, and an end token per clip if the grid has one.
    pub fn n_targets(&self, split: Split) -> usize {
        self.n_tokens(split) + usize::from(self.grid.end_token) * self.n_clips(split)
    }

    /// The targets of a clip: its codes, and the end token if the grid has one.
    pub fn n_targets_of_clip(&self, split: Split, index: usize) -> usize {
        self.clip(split, index).len() + usize::from(self.grid.end_token)
    }

    /// Test targets whose code the training split never showed, end tokens aside.
    pub fn zero_count_targets(&self) -> usize {
        let mut seen = vec![false; self.n_vocab()];
        for index in 0..self.n_clips(Split::Train) {
            self.stream(Split::Train, index).iter().for_each(|&id| seen[id as usize] = true);
        }
        let unseen = |index: usize| {
            self.stream(Split::Test, index).iter().filter(|&&id| !seen[id as usize]).count()
        };
        (0..self.n_clips(Split::Test)).map(unseen).sum()
    }

    /// The frames of a split covered by its codes.
    pub fn n_frames(&self, split: Split) -> usize {
        self.split(split).frames.values().iter().sum::<u64>() as usize
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

    /// The frames of a clip covered by its codes.
    pub fn clip_frames(&self, split: Split, index: usize) -> usize {
        self.split(split).frames.values()[index] as usize
    }

    /// The group of each clip of a split: clips with one number were recorded together. `None` if the
    /// file does not say.
    pub fn groups(&self, split: Split) -> Option<&[u32]> {
        self.split(split).groups.as_ref().map(Column::values)
    }

    /// The codes of a clip as ids of one vocabulary, the concatenation of the codebooks: ids of a scale are offset by the
    /// earlier codebooks.
    pub fn stream(&self, split: Split, index: usize) -> Cow<'_, [u32]> {
        let codes = self.clip(split, index);
        if self.grid.scales.len() == 1 {
            return Cow::Borrowed(codes);
        }
        let frames = self.clip_frames(split, index);
        let scales = self.grid.offsets().zip(self.grid.lengths(frames));
        let offsets = scales.flat_map(|(offset, length)| std::iter::repeat_n(offset, length));
        codes.iter().zip(offsets).map(|(code, offset)| code + offset as u32).collect()
    }

    /// The codes of a split, clip after clip.
    pub fn codes(&self, split: Split) -> &[u32] {
        self.split(split).codes.values()
    }

    /// The codes of a scale in a clip.
    pub fn scale(&self, split: Split, index: usize, scale: usize) -> &[u32] {
        let frames = self.clip_frames(split, index);
        let mut lengths = self.grid.lengths(frames);
        let from: usize = lengths.by_ref().take(scale).sum();
        &self.clip(split, index)[from..from + lengths.next().unwrap_or(0)]
    }

    /// ln p_uni of each code of a scale and, last, of the end token, `[V + 1]`, in nats.
    ///
    /// p_uni(k) = (count(k) + 1) / (total + V + 1) over the training split with one end token a
    /// clip: the denominator of the normalised loss (ScaMo §4.4), smoothed because at a large V
    /// some codes of the test split are new.
    pub fn unigram_log_probs(&self, scale: usize) -> Vec<f64> {
        let n_clips = self.n_clips(Split::Train);
        let n_vocab = self.grid.scales[scale].n_vocab;
        let clips = (0..n_clips).flat_map(|clip| self.scale(Split::Train, clip, scale));
        let counts = CodeHistogram::new(n_vocab, clips);
        let codes: u64 = counts.counts().iter().sum();
        let ends = if self.grid.end_token { n_clips as u64 } else { 0 };
        let total = (codes + ends + n_vocab as u64 + 1) as f64;
        let counts = counts.counts().iter().chain([&ends]);
        counts.map(|&count| ((count + 1) as f64 / total).ln()).collect()
    }

    /// ln p_uni of each id of [`TokenStore::stream`] and, last, of the end token, `[V + 1]`, in nats: each by the table of
    /// its own scale, so the unigram model knows the scale.
    pub fn stream_log_probs(&self) -> Vec<f64> {
        let mut probs = Vec::with_capacity(self.n_vocab() + 1);
        for scale in 0..self.grid.scales.len() {
            // The end token of the scale before.
            probs.truncate(probs.len().saturating_sub(1));
            probs.extend(self.unigram_log_probs(scale));
        }
        probs
    }

    /// The clips of a share of the training split, in their order.
    ///
    /// Each clip is drawn separately, so the first pass over a share is as varied as the same number of tokens of the whole
    /// split: shares then differ only in repetition. A smaller share is a part of a larger one, and all seeds have the same
    /// shares.
    pub fn training_clips(&self, share: Share) -> Vec<usize> {
        let mut clips: Vec<usize> = (0..self.n_clips(Split::Train)).collect();
        if !share.is_whole() {
            clips.sort_by_cached_key(|clip| *blake3::hash(&clip.to_le_bytes()).as_bytes());
            clips.truncate(share.of(clips.len()));
            clips.sort_unstable();
        }
        clips
    }

    /// The targets of a share of the training split, end tokens included.
    pub fn training_targets(&self, share: Share) -> usize {
        let clips = self.training_clips(share).into_iter();
        clips.map(|clip| self.n_targets_of_clip(Split::Train, clip)).sum()
    }

    fn split(&self, split: Split) -> &StoredSplit {
        &self.splits[split as usize]
    }
}

impl StoredSplit {
    /// The columns of a split, checked.
    fn read(file: &ColumnFile, split: Split, grid: &Grid) -> Result<Self, FileError> {
        let codes = file.column(&name(split, CODES))?;
        let offsets = file.column(&name(split, OFFSETS))?;
        let groups = name(split, GROUPS);
        let groups = file.has(&groups).then(|| file.column(&groups)).transpose()?;
        let split = Self { codes, offsets, frames: file.column(&name(split, FRAMES))?, groups };
        let damaged = || file.damaged("its codes and offsets disagree");
        split.is_sound(grid).then_some(split).ok_or_else(damaged)
    }

    fn is_sound(&self, grid: &Grid) -> bool {
        let (codes, offsets) = (self.codes.values(), self.offsets.values());
        offsets.first() == Some(&0)
            && offsets.last() == Some(&(codes.len() as u64))
            && offsets.is_sorted()
            && offsets.len() == self.frames.values().len() + 1
            && self.groups.as_ref().is_none_or(|own| own.values().len() + 1 == offsets.len())
            && self.clips_are_sound(grid)
    }

    /// Whether each clip has the codes that its frames ask for, each in its codebook.
    fn clips_are_sound(&self, grid: &Grid) -> bool {
        let spans = self.offsets.values().windows(2).map(|w| w[0] as usize..w[1] as usize);
        spans.zip(self.frames.values()).all(|(span, frames)| {
            let mut codes = &self.codes.values()[span];
            let mut scales = grid.scales.iter().zip(grid.lengths(*frames as usize));
            let sound = scales.all(|(scale, length)| {
                let Some((own, rest)) = codes.split_at_checked(length) else { return false };
                codes = rest;
                own.iter().all(|code| (*code as usize) < scale.n_vocab)
            });
            sound && codes.is_empty()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(clips: &[&[u32]]) -> SplitTokens {
        SplitTokens::new(clips.iter().map(|clip| (*clip, 4 * clip.len())))
    }

    fn store(n_vocab: usize, train: &[&[u32]]) -> Result<TokenStore, FileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens.safetensors");
        let splits = [tokens(train), tokens(&[]), tokens(&[&[2]])];
        write_store(&path, &Grid::stream(n_vocab, 4), &splits).unwrap();
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
        let probs: Vec<f64> = store.unigram_log_probs(0).iter().map(|p| p.exp()).collect();
        let expected = [4.0, 2.0, 1.0, 1.0, 3.0].map(|count| count / 11.0);
        assert!(probs.iter().zip(expected).all(|(p, e)| (p - e).abs() < 1e-12), "{probs:?}");
        assert_eq!(probs.len(), 5);
    }

    #[test]
    fn a_code_beyond_the_codebook_is_refused() {
        let error = store(3, &[&[0, 3]]).unwrap_err().to_string();
        assert!(error.contains("is damaged"), "{error}");
    }

    #[test]
    fn a_cut_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens.safetensors");
        let split = tokens(&[&[1, 2, 3]]);
        write_store(&path, &Grid::stream(4, 4), &[split.clone(), split.clone(), split]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 4]).unwrap();
        assert!(TokenStore::open(&path).is_err());
    }

    #[test]
    fn scales_have_their_own_codes_and_unigrams() {
        use crate::spec::{Length, Scale};
        let scale = |n_vocab, codes| Scale { n_vocab, length: Length::Codes(codes) };
        let grid = Grid { scales: vec![scale(2, 1), scale(3, 2)], end_token: false };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens.safetensors");
        let train = SplitTokens::new([(&[1, 2, 0][..], 40), (&[1, 2, 2][..], 60)]);
        let none = SplitTokens::new([]);
        write_store(&path, &grid, &[train, none.clone(), none]).unwrap();
        let store = TokenStore::open(&path).unwrap();
        assert_eq!(store.scale(Split::Train, 0, 0), [1]);
        assert_eq!(store.scale(Split::Train, 1, 1), [2, 2]);
        assert_eq!((store.n_targets(Split::Train), store.n_frames(Split::Train)), (6, 100));
        assert_eq!(*store.stream(Split::Train, 0), [1, 4, 2]);
        let probs = store.stream_log_probs();
        assert_eq!(probs[..2], store.unigram_log_probs(0)[..2]);
        assert_eq!(probs[2..], store.unigram_log_probs(1));
        let of = |scale: usize| -> Vec<f64> {
            store.unigram_log_probs(scale).iter().map(|p| p.exp()).collect()
        };
        let near = |found: Vec<f64>, counts: &[f64]| {
            let total: f64 = counts.iter().sum();
            found.iter().zip(counts).all(|(p, count)| (p - count / total).abs() < 1e-12)
        };
        assert!(near(of(0), &[1.0, 3.0, 1.0]), "{:?}", of(0));
        assert!(near(of(1), &[2.0, 1.0, 4.0, 1.0]), "{:?}", of(1));
        let (seen, unseen) = (SplitTokens::new([(&[1, 0, 0][..], 40)]), [(&[1, 2, 0][..], 40)]);
        write_store(&path, &grid, &[seen.clone(), seen, SplitTokens::new(unseen)]).unwrap();
        assert_eq!(TokenStore::open(&path).unwrap().zero_count_targets(), 1);
        let wrong = SplitTokens::new([(&[1, 3, 0][..], 40)]);
        write_store(&path, &grid, &[wrong.clone(), wrong.clone(), wrong]).unwrap();
        assert!(TokenStore::open(&path).unwrap_err().is_damage());
    }
}
