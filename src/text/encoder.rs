//! [`TextEncoder`]: what turns a caption into a sequence of vectors.

use super::embedding_file::EmbeddingFile;
use super::error::TextError;
use super::hashed_ngrams::HashedNgrams;
use crate::spec::{TextEncoderKind, TextSpec};

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

    /// Hex digest of what the vectors follow from beside the spec; `None` where nothing is.
    fn digest(&self) -> Option<String> {
        None
    }
}

/// The encoder that a sweep asks for.
///
/// # Errors
/// Its file cannot be used.
pub fn encoder(spec: &TextSpec) -> Result<Box<dyn TextEncoder>, TextError> {
    let TextSpec { dim, max_tokens, .. } = *spec;
    Ok(match spec.encoder {
        TextEncoderKind::HashedNgrams => Box::new(HashedNgrams::new(dim, max_tokens)),
        TextEncoderKind::File => {
            let path = spec.path.as_deref().expect("checked when the sweep was read");
            Box::new(EmbeddingFile::open(path, dim, max_tokens)?)
        }
    })
}
