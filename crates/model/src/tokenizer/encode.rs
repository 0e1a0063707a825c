//! Tokenises a whole data set into a [`TokenStore`](crate::codes::TokenStore)'s file; intermediate results are kept in
//! [`Parts`], so that a killed process loses little.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::TokenizerError;
use super::codec::Tokenizer;
use super::corpus::{ClipBatch, Corpus, equal_length_batches};
use crate::codes::{SplitTokens, write_store};
use crate::data::Split;
use crate::files::FileError;
use crate::files::columns::{ColumnFile, NewColumn, write};
use crate::progress::{Stop, moved};
use crate::text::TextStore;

/// Tokenises every clip of every split into one file at `path`, renamed into place. Keeps intermediate results in
/// `parts`, and resumes from them.
///
/// `None` if stopped between two parts.
///
/// # Errors
/// A clip cannot be read or is shorter than a token, a file cannot be written, or the captions changed meanwhile.
pub fn tokenize(
    tokenizer: &Tokenizer,
    corpus: &Corpus,
    path: &Path,
    parts: Parts,
) -> Result<Option<()>, TokenizerError> {
    let splits = Split::ALL.iter().map(|&split| tokenize_split(tokenizer, corpus, split, parts));
    let Some(splits) = splits.collect::<Result<Option<Vec<_>>, _>>()? else { return Ok(None) };
    if let Err(changed) = corpus.text.map_or(Ok(()), TextStore::unchanged) {
        // Made of the changed captions, too.
        std::fs::remove_dir_all(parts.folder).map_err(FileError::write(parts.folder))?;
        return Err(changed.into());
    }
    Ok(Some(write_store(path, &tokenizer.spec().grid(), &splits)?))
}

/// The codes of every clip of a split, in the split's order; `None`: stopped.
///
/// Batches are shared out over the threads; a clip's codes depend on neither.
fn tokenize_split(
    tokenizer: &Tokenizer,
    corpus: &Corpus,
    split: Split,
    parts: Parts,
) -> Result<Option<SplitTokens>, TokenizerError> {
    let (source, captions) = (corpus.source, corpus.read_by(tokenizer.spec())?);
    let batches = equal_length_batches(source, split, tokenizer.spec().stride())?;
    let encode = |batch: &ClipBatch| {
        let features = batch.features(source, split)?;
        let captions = captions.as_ref().map(|read| read.of(split, &batch.indices));
        let ids = tokenizer.encode_stack(features, batch.indices.len(), captions.as_ref());
        moved();
        Ok(ids)
    };
    let Some(ids) = in_parts(&batches, split, parts, encode)? else { return Ok(None) };
    let mut clips = vec![(&[] as &[u32], 0); source.n_clips(split)];
    for (batch, ids) in batches.iter().zip(&ids) {
        let n_tokens = ids.len() / batch.indices.len();
        for (&index, clip) in batch.indices.iter().zip(ids.chunks_exact(n_tokens)) {
            clips[index] = (clip, batch.n_frames);
        }
    }
    let groups = (0..clips.len()).map(|clip| source.group(split, clip));
    Ok(Some(SplitTokens::new(clips).in_groups(groups)))
}

/// The codes of every batch, kept or computed now; `None` if stopped.
fn in_parts(
    batches: &[ClipBatch],
    split: Split,
    parts: Parts,
    encode: impl Fn(&ClipBatch) -> Result<Vec<u32>, TokenizerError> + Sync,
) -> Result<Option<Vec<Vec<u32>>>, TokenizerError> {
    let n_parts = batches.len().div_ceil(BATCHES);
    let mut all = Vec::with_capacity(batches.len());
    for (part, batches) in batches.chunks(BATCHES).enumerate() {
        if parts.stop.is_raised() {
            return Ok(None);
        }
        let path = parts.file(split, part, n_parts);
        if let Some(codes) = kept(&path).filter(|codes| codes.len() == batches.len()) {
            all.extend(codes);
            continue;
        }
        let made = batches.par_iter().map(&encode).collect::<Result<Vec<_>, _>>()?;
        keep(&path, &made)?;
        all.extend(made);
    }
    Ok(Some(all))
}

// Codes that are kept while a data set is tokenised.

/// Batches of a part: about 130,000 frames.
const BATCHES: usize = 64;

/// The folder of the codes of batches until all are done, and the flag that stops between parts.
#[derive(Clone, Copy, Debug)]
pub struct Parts<'a> {
    /// Made where it is missing.
    pub folder: &'a Path,
    pub stop: &'a Stop,
}

impl Parts<'_> {
    /// The file of a split's part; its name says how many there are.
    fn file(&self, split: Split, part: usize, n_parts: usize) -> PathBuf {
        self.folder.join(format!("{}-{part}-of-{n_parts}.safetensors", split.name()))
    }
}

/// The share of a data set whose codes are kept; 0 if none are. Parts count alike.
pub fn share_kept(folder: &Path) -> f64 {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names: Vec<String> =
        names.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    let n_parts = |split: Split| {
        let of = names.iter().filter(|name| name.starts_with(split.name()));
        let total =
            of.filter_map(|name| name.split_once("-of-")?.1.split('.').next()?.parse().ok());
        total.max().unwrap_or(0)
    };
    // Splits are tokenised in turn, the training split first and by far the longest.
    let total: usize = Split::ALL.into_iter().map(n_parts).sum();
    let kept = names.iter().filter(|name| name.ends_with(".safetensors")).count();
    if total == 0 { 0.0 } else { (kept as f64 / total as f64).min(1.0) }
}

/// Keeps the codes of a part's batches, whole, by rename.
fn keep(path: &Path, batches: &[Vec<u32>]) -> Result<(), FileError> {
    let codes = batches.concat();
    let lengths: Vec<u64> = batches.iter().map(|codes| codes.len() as u64).collect();
    write(path, &[NewColumn::new(CODES, &codes), NewColumn::new(LENGTHS, &lengths)], None)
}

/// The codes of a part's batches; `None` if they are not kept, or not whole.
fn kept(path: &Path) -> Option<Vec<Vec<u32>>> {
    let file = ColumnFile::open(path).and_then(ColumnFile::verified).ok()?;
    let (codes, lengths) = (file.column::<u32>(CODES).ok()?, file.column::<u64>(LENGTHS).ok()?);
    let mut rest = codes.values();
    let batch = |length: &u64| {
        let (own, others) = rest.split_at_checked(*length as usize)?;
        rest = others;
        Some(own.to_vec())
    };
    let batches: Option<Vec<Vec<u32>>> = lengths.values().iter().map(batch).collect();
    batches.filter(|_| rest.is_empty())
}

const CODES: &str = "codes";
const LENGTHS: &str = "lengths";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codes::TokenStore;
    use crate::data::MotionSource;
    use crate::motion::N_FEATURES;
    use crate::spec::{LanguagePlace, QuantizerSpec, TokenizerSpec};
    use crate::tokenizer::testing::{D_TEXT, Waves, small_spec, text_of, transformer_spec};
    use crate::tokenizer::train;
    use burn::tensor::Device;
    use std::ops::ControlFlow;

    #[test]
    fn codes_of_a_clip_do_not_depend_on_the_clips_beside_it() {
        let quantizer = QuantizerSpec::Fsq { levels: vec![5, 3] };
        let places = [LanguagePlace::Tokenizer, LanguagePlace::Detokenizer];
        let transformer = transformer_spec(&places, quantizer, 5);
        for (spec, n_features) in [(small_spec(), 9), (transformer, N_FEATURES)] {
            let lengths: Vec<usize> = (0..60).map(|i| 16 + 4 * (i % 7)).collect();
            codes_depend_on_nothing_beside(&spec, &Waves::new(&lengths, n_features));
        }
    }

    fn codes_depend_on_nothing_beside(spec: &TokenizerSpec, source: &Waves) {
        let keep_on = &mut |_| ControlFlow::Continue(());
        let text = text_of(source, D_TEXT);
        let corpus = Corpus { source, text: Some(&text) };
        let tokenizer = train(spec, &corpus, &Device::flex(), None, keep_on).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens.safetensors");
        let (stop, parts) = (Stop::default(), folder.path().join("parts"));
        let parts = Parts { folder: &parts, stop: &stop };
        tokenize(&tokenizer, &corpus, &path, parts).unwrap();
        let store = TokenStore::open(&path).unwrap();
        for split in Split::ALL {
            assert_eq!(store.n_clips(split), 60);
            for index in 0..60 {
                let captions = text.captions(split, index);
                let caption = text.embedding(captions[index % captions.len()]);
                let features = source.features(split, index).unwrap();
                let alone = tokenizer.encode(&features, Some(caption)).unwrap();
                assert_eq!(store.clip(split, index), alone, "{split:?} {index}");
                assert_eq!(alone.len(), source.n_frames(split, index) / 4);
            }
        }
    }

    #[test]
    fn tokenising_goes_on_from_what_is_kept_to_the_same_bytes() {
        // A batch a clip: 70 batches, two parts a split.
        let source = Waves::new(&[1500; 70], 9);
        let corpus = Corpus { source: &source, text: None };
        let keep_on = &mut |_| ControlFlow::Continue(());
        let tokenizer = train(&small_spec(), &corpus, &Device::flex(), None, keep_on).unwrap();
        let (folder, stop) = (tempfile::tempdir().unwrap(), Stop::default());
        let run = |name: &str, stop: &Stop| {
            let (path, kept) =
                (folder.path().join(format!("{name}.safetensors")), folder.path().join("parts"));
            let done = tokenize(&tokenizer, &corpus, &path, Parts { folder: &kept, stop }).unwrap();
            done.map(|()| std::fs::read(path).unwrap())
        };
        let whole = run("whole", &stop).expect("not stopped");
        let parts = Parts { folder: &folder.path().join("parts"), stop: &stop };
        // A part is gone, one is cut, and one is of another batch size.
        std::fs::remove_file(parts.file(Split::Test, 0, 2)).unwrap();
        std::fs::write(parts.file(Split::Val, 1, 2), b"cut").unwrap();
        keep(&parts.file(Split::Train, 1, 2), &[vec![0; 375]]).unwrap();
        let raised = Stop::default();
        raised.raise();
        assert_eq!(run("stopped", &raised), None);
        assert!(run("again", &stop).expect("not stopped") == whole);
        // What is kept is used, and not made again.
        keep(&parts.file(Split::Train, 1, 2), &vec![vec![0; 375]; 6]).unwrap();
        assert!(run("changed", &stop).expect("not stopped") != whole);
    }

    #[test]
    fn a_part_is_read_as_it_was_kept_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let stop = Stop::default();
        let parts = Parts { folder: folder.path(), stop: &stop };
        assert_eq!(share_kept(folder.path()), 0.0);
        let path = parts.file(Split::Train, 0, 4);
        let batches = vec![vec![3, 1, 4], vec![], vec![1, 5]];
        keep(&path, &batches).unwrap();
        assert_eq!((kept(&path), share_kept(folder.path())), (Some(batches), 0.25));
        let bytes = std::fs::read(&path).unwrap();
        for end in [0, 7, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..end]).unwrap();
            assert_eq!(kept(&path), None, "{end}");
        }
        assert_eq!(kept(&parts.file(Split::Train, 1, 4)), None);
    }
}
