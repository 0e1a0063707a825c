//! A sweep's results in forms for other programs.
//!
//! # Example
//!
//! ```
//! use isoflop::export::{NotebookInput, notebook};
//!
//! let input = NotebookInput { name: "first", results: "../results/first" };
//! assert_eq!(notebook(&input)["nbformat"], 4);
//! ```

mod notebook;

pub use notebook::{NotebookInput, notebook};
