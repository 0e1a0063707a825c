//! Tokenising a whole data set, once, into a [`TokenStore`](crate::codes::TokenStore)'s file.

use std::path::Path;

use rayon::prelude::*;

use super::batches::{ClipBatch, equal_length_batches};
use super::codec::Tokenizer;
use super::corpus::Corpus;
use super::error::TokenizerError;
use super::parts::{BATCHES, Parts, keep, kept};
use crate::codes::{SplitTokens, write_store};
use crate::data::Split;
use crate::progress::moved;

/// Tokenises every clip of every split into one file at `path`, written whole, by rename. What it has made so
/// far it keeps in `parts`, and goes on from there.
///
/// `None`: stopped between two parts.
///
/// # Errors
/// A clip cannot be read or is shorter than a token, or a file cannot be written.
pub fn tokenize(
    tokenizer: &Tokenizer,
    corpus: &Corpus,
    path: &Path,
    parts: Parts,
) -> Result<Option<()>, TokenizerError> {
    let splits = Split::ALL.iter().map(|&split| tokenize_split(tokenizer, corpus, split, parts));
    let Some(splits) = splits.collect::<Result<Option<Vec<_>>, _>>()? else { return Ok(None) };
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
    let batches = equal_length_batches(source, split, tokenizer.spec().frames_per_latent())?;
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

/// The codes of every batch, those that are kept and those that are made now; `None`: stopped.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codes::TokenStore;
    use crate::data::MotionSource;
    use crate::motion::N_FEATURES;
    use crate::progress::Stop;
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
}
