//! Tokenising a whole data set, once, into a [`TokenStore`](crate::codes::TokenStore)'s file.

use std::path::Path;

use rayon::prelude::*;

use super::batches::{ClipBatch, equal_length_batches};
use super::codec::Tokenizer;
use super::corpus::Corpus;
use super::error::TokenizerError;
use crate::codes::{SplitTokens, write_store};
use crate::data::Split;
use crate::progress::moved;

/// Tokenises every clip of every split into one file at `path`, written whole, by rename.
pub fn tokenize(tokenizer: &Tokenizer, corpus: &Corpus, path: &Path) -> Result<(), TokenizerError> {
    let splits = Split::ALL.iter().map(|&split| tokenize_split(tokenizer, corpus, split));
    let splits = splits.collect::<Result<Vec<_>, _>>()?;
    Ok(write_store(path, &tokenizer.spec().grid(), &splits)?)
}

/// The codes of every clip of a split, in the split's order.
///
/// Batches are shared out over the threads; a clip's codes depend on neither.
pub fn tokenize_split(
    tokenizer: &Tokenizer,
    corpus: &Corpus,
    split: Split,
) -> Result<SplitTokens, TokenizerError> {
    let (source, captions) = (corpus.source, corpus.read_by(tokenizer.spec())?);
    let batches = equal_length_batches(source, split, tokenizer.spec().frames_per_latent())?;
    let encode = |batch: &ClipBatch| {
        let features = batch.features(source, split)?;
        let captions = captions.as_ref().map(|read| read.of(split, &batch.indices));
        let ids = tokenizer.encode_stack(features, batch.indices.len(), captions.as_ref());
        moved();
        Ok(ids)
    };
    let ids = batches.par_iter().map(encode).collect::<Result<Vec<_>, TokenizerError>>()?;
    let mut clips = vec![(&[] as &[u32], 0); source.n_clips(split)];
    for (batch, ids) in batches.iter().zip(&ids) {
        let n_tokens = ids.len() / batch.indices.len();
        for (&index, clip) in batch.indices.iter().zip(ids.chunks_exact(n_tokens)) {
            clips[index] = (clip, batch.n_frames);
        }
    }
    Ok(SplitTokens::new(clips))
}

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
        tokenize(&tokenizer, &corpus, &path).unwrap();
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
}
