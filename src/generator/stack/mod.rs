//! The blocks that generators are made of, over whole sequences and over such that grow.

mod block;
mod growing;
mod layers;

pub use block::Block;
pub use growing::{Growing, padded};
pub use layers::{EPSILON, Stack, kernels_of, single};
