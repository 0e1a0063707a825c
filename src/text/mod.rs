//! Frozen text embeddings: made once for a data set, shared by every run.

mod embedding_file;
mod encoder;
mod error;
mod hashed_ngrams;
mod store;

pub use embedding_file::{EmbeddingFile, caption_key};
pub use encoder::{TextEncoder, encoder};
pub use error::TextError;
pub use hashed_ngrams::HashedNgrams;
pub use store::{TextStore, embed};
