//! Frozen text embeddings: made once for a data set, shared by every run. A file an encoder.

mod embedding_file;
mod encoder;
mod error;
mod hashed_ngrams;
mod store;

pub use embedding_file::{EmbeddingFile, caption_key};
pub use encoder::TextEncoder;
pub use error::TextError;
pub use hashed_ngrams::HashedNgrams;
pub use store::{TextStore, embed};

use crate::spec::{TextEncoderKind, TextSpec};

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

/// A caption as captions of data are read: lower-case, with single spaces.
pub fn as_in_data(caption: &str) -> String {
    let words: Vec<String> = caption.split_whitespace().map(str::to_lowercase).collect();
    words.join(" ")
}
