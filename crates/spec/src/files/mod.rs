//! Files: written whole, by rename; mapped; read as JSON; set aside where they are damaged; TensorBoard's events.
//!
//! # Example
//!
//! ```
//! use isoflop_spec::files::{atomic, read_if_there};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("budget.json");
//! assert_eq!(read_if_there::<f64>(&path)?, None);
//! atomic::write_json(&path, &1e18)?; // whole, by rename
//! assert_eq!(read_if_there(&path)?, Some(1e18));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod atomic;
pub mod columns;
pub mod damaged;
mod error;
mod json;
mod regular;
pub mod tensorboard;

pub use error::{FileError, failure_kind};
pub use json::{read_if_there, read_text_if_there};
pub use regular::{LARGE, SMALL, read_regular, read_text};
