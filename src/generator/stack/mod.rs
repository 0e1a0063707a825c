//! The blocks that generators are made of, over whole sequences and over such that grow.

mod block;
mod growing;
mod heads;
mod layers;

pub use block::Block;
pub use growing::{Growing, padded};
pub use heads::{Supervised, heads_loss, heads_nll, n_supervised};
pub use layers::{Backbone, EPSILON, kernels_of};
