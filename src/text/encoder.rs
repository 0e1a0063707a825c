//! [`TextEncoder`]: what turns a caption into a sequence of vectors.

use super::hashed_ngrams::HashedNgrams;
use crate::spec::{TextEncoderKind, TextSpec};

/// A frozen encoder of captions.
pub trait TextEncoder: Sync {
    /// Width of a vector.
    fn dim(&self) -> usize;

    /// One vector a text token, `[n_tokens, dim]` row-major, at least one and at most the limit
    /// that the encoder was made with.
    fn encode(&self, caption: &str) -> Vec<f32>;

    /// How results are to be labelled for a person.
    fn label(&self) -> &'static str;
}

/// The encoder that a sweep asks for.
pub fn encoder(spec: &TextSpec) -> Box<dyn TextEncoder> {
    match spec.encoder {
        TextEncoderKind::HashedNgrams => Box::new(HashedNgrams::new(spec.dim, spec.max_tokens)),
    }
}
