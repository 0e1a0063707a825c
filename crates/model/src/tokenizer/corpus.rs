//! [`Corpus`]: the clips that a tokenizer reads, and their captions.

use rand_chacha::ChaCha8Rng;

use super::captions::Captions;
use super::error::TokenizerError;
use crate::data::{MotionSource, Split};
use crate::learn::params::{below, unit};
use crate::spec::{LanguageSpec, TokenizerSpec};
use crate::text::TextStore;

/// Clips, and their captions as vectors for tokenizers that have language.
#[derive(Clone, Copy)]
pub struct Corpus<'a> {
    pub source: &'a dyn MotionSource,
    pub text: Option<&'a TextStore>,
}

impl<'a> Corpus<'a> {
    /// Clips without their captions.
    pub fn wordless(source: &'a dyn MotionSource) -> Self {
        Self { source, text: None }
    }

    /// What a tokenizer reads of the captions; `None` where it has no language.
    ///
    /// # Errors
    /// It has language, and there are no vectors or they are of another width.
    pub(super) fn read_by(
        &self,
        spec: &TokenizerSpec,
    ) -> Result<Option<ReadCaptions<'a>>, TokenizerError> {
        let Some(language) = spec.architecture.language() else { return Ok(None) };
        let store = self.text.ok_or(TokenizerError::NoText)?;
        if store.dim() != language.dim {
            let (found, wanted) = (store.dim(), language.dim);
            return Err(TokenizerError::TextWidth { found, wanted });
        }
        Ok(Some(ReadCaptions { store, language: language.clone() }))
    }
}

/// The captions of a data set, as a tokenizer with language reads them.
#[derive(Clone, Debug)]
pub struct ReadCaptions<'a> {
    store: &'a TextStore,
    language: LanguageSpec,
}

impl ReadCaptions<'_> {
    /// The captions of clips outside training: clip i shows caption i mod n.
    pub fn of(&self, split: Split, clips: &[usize]) -> Captions {
        let shown = |&clip: &usize| {
            let captions = self.store.captions(split, clip);
            self.store.embedding(captions[clip % captions.len()])
        };
        Captions::of(clips.iter().map(shown), self.store.dim())
    }

    /// The captions of training clips: one of each clip's, or none, as often as the spec says.
    pub fn drawn(&self, clips: &[usize], rng: &mut ChaCha8Rng) -> Captions {
        let drawn = |&clip: &usize| -> &[f32] {
            let captions = self.store.captions(Split::Train, clip);
            let caption = captions[below(rng, captions.len())];
            let is_dropped = unit(rng) < self.language.drop;
            if is_dropped { &[] } else { self.store.embedding(caption) }
        };
        Captions::of(clips.iter().map(drawn), self.store.dim())
    }
}
