//! A sweep's results in forms for other programs.

mod notebook;

pub use notebook::{NotebookInput, notebook};
