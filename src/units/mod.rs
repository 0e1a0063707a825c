//! Numbers and amounts of memory as people write them.
//!
//! # Example
//!
//! ```
//! assert_eq!(isoflop::units::parse_bytes("24 GiB"), Ok(24 << 30));
//! ```

mod bytes;
pub mod number;
mod shell;

pub use bytes::parse_bytes;
pub use shell::quoted;
