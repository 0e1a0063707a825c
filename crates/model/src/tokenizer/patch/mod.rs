//! The architecture of patches: whole frames into latents, each begun as the principal components of
//! its own frames and mended by residual convolutions; and back.

mod block;
mod components;
mod network;

pub use network::{PatchDecoder, PatchEncoder};
