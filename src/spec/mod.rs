//! Descriptions of what is trained: plain data, closed, hashable, free of burn.

pub mod flops;
mod id;
mod levels;
mod memory;
mod precision;
mod quantizer;
mod shape;
mod text;
mod tokenizer;

pub use id::{changed_fields, content_id};
pub use levels::{digits_of_index, index_of_digits, levels_for, n_codes, nominal_sizes};
pub use memory::{TARGETS_PER_PASS, peak_bytes};
pub use precision::Precision;
pub use quantizer::QuantizerSpec;
pub use shape::{Ffn, ModelShape, ParamCounts};
pub use text::{TextEncoderKind, TextSpec};
pub use tokenizer::{SpecError, TokenizerSpec};
