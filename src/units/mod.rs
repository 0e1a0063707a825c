//! Numbers and amounts of memory as people write them.
//!
//! # Example
//!
//! ```
//! assert_eq!(isoflop::units::parse_bytes("24 GiB"), Ok(24 << 30));
//! ```

mod bytes;
pub mod number;
mod section;
mod shell;
mod ways;

pub use bytes::parse_bytes;
pub use section::is_default;
pub(crate) use section::{or_default, section};
pub use shell::quoted;
pub use ways::Ways;
