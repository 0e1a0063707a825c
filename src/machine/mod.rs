//! What this machine and this process have of memory; GPUs by name.
//!
//! # Example
//!
//! ```
//! use isoflop::machine::{memory, peak};
//!
//! let free = memory::available().unwrap_or(u64::MAX);
//! assert!(free > 0 && peak::peak_bytes() > 0);
//! ```

pub mod allocator;
pub mod cards;
pub mod memory;
pub mod oom;
pub mod peak;
