//! ScaMo's text-prefix autoregressive transformer.

mod batch;
mod transformer;

pub use batch::{Batch, Sequence};
pub use transformer::{Model, Transformer, end_token};
