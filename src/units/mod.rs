//! Numbers and amounts of memory as people write them.

mod bytes;
pub mod number;
mod shell;

pub use bytes::parse_bytes;
pub use shell::quoted;
