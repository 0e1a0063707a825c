//! The text-motion matching networks of Guo et al. (2022), trained in one stage: convolutions that make
//! four frames one row, bidirectional GRUs, and a margin. Words are hashed n-grams in place of GloVe
//! vectors and parts of speech, and the convolutions are not trained as an autoencoder first.

mod gru;
mod margin;
mod movement;
mod networks;
mod order;
mod reader;

pub use networks::MatchingNetworks;
