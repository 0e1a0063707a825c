//! Frozen text embeddings: made once for a data set, shared by every run.

mod encoder;
mod hashed_ngrams;
mod store;

pub use encoder::{TextEncoder, encoder};
pub use hashed_ngrams::HashedNgrams;
pub use store::{TextStore, embed};
