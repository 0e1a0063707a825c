//! Files: written whole, by rename; mapped; read as JSON; set aside where they are damaged.

pub mod atomic;
pub mod columns;
pub mod damaged;
mod error;
mod json;

pub use error::{FileError, failure_kind};
pub use json::{read_if_there, read_text_if_there};
