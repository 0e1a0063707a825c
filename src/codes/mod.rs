//! The codes of a data set: what lies between a tokenizer and a generator.

mod clip_codes;
mod histogram;
mod store;

pub use clip_codes::{ClipCodes, ClipScale};
pub use histogram::CodeHistogram;
pub use store::{SplitTokens, TokenStore, write_store};

pub use crate::spec::{Grid, Length, Scale};
