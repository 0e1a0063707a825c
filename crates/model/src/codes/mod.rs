//! The codes of a data set: what lies between a tokenizer and a generator.
//!
//! # Example
//!
//! ```
//! use isoflop_model::codes::CodeHistogram;
//!
//! let histogram = CodeHistogram::new(4, &[0, 1, 1, 2]);
//! assert_eq!(histogram.utilisation(), 0.75); // three of four codes are met
//! ```

mod clip_codes;
mod histogram;
mod share;
mod store;

pub use clip_codes::{ClipCodes, ClipScale};
pub use histogram::CodeHistogram;
pub use store::{SplitTokens, TokenStore, write_store};

pub use crate::spec::{Grid, Length, Scale};
