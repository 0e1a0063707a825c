//! [`TextEncoder`]: what turns a caption into a sequence of vectors.

use super::error::TextError;

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

    /// How many vectors [`encode`](Self::encode) gives, without making them.
    ///
    /// # Errors
    /// As there.
    fn n_tokens(&self, caption: &str) -> Result<usize, TextError>;

    /// The same of several captions, in their order.
    fn encode_all(&self, captions: &[String]) -> Vec<Result<Vec<f32>, TextError>> {
        captions.iter().map(|caption| self.encode(caption)).collect()
    }

    /// Hex digest of what the vectors follow from beside the spec; `None` where nothing is.
    fn digest(&self) -> Option<String> {
        None
    }
}
