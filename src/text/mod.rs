//! Frozen text embeddings: made once for a data set, shared by every run. A file an encoder.
//!
//! # Example
//!
//! ```
//! use isoflop::spec::TextSpec;
//! use isoflop::text;
//!
//! let encoder = text::encoder(&TextSpec::default())?;
//! let vectors = encoder.encode("a person walks")?; // one vector a token
//! assert_eq!(vectors.len() % encoder.dim(), 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod embedding_file;
mod encoder;
mod error;
mod hashed_ngrams;
#[cfg(feature = "encoders")]
mod models;
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
        TextEncoderKind::T5
        | TextEncoderKind::Clip
        | TextEncoderKind::Bert
        | TextEncoderKind::Llama => return with_weights(spec),
    })
}

/// An encoder from a folder with its weights.
#[cfg(feature = "encoders")]
fn with_weights(spec: &TextSpec) -> Result<Box<dyn TextEncoder>, TextError> {
    let path = spec.path.as_deref().expect("checked when the sweep was read");
    Ok(Box::new(models::LocalModel::open(path, spec)?))
}

/// Such encoders are not built in.
#[cfg(not(feature = "encoders"))]
fn with_weights(spec: &TextSpec) -> Result<Box<dyn TextEncoder>, TextError> {
    let folder = spec.path.clone().unwrap_or_default();
    let reason = "this isoflop was built without `--features encoders`".to_string();
    Err(TextError::Model { folder, reason })
}

/// A caption as captions of data are read: lower-case, with single spaces.
pub fn as_in_data(caption: &str) -> String {
    let words: Vec<String> = caption.split_whitespace().map(str::to_lowercase).collect();
    words.join(" ")
}
