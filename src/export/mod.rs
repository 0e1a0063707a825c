//! A sweep's results in forms for other programs.

mod notebook;
mod tensorboard;

pub use notebook::{NotebookInput, notebook};
pub use tensorboard::{Scalar, events};
