//! The language-guided transformer of LG-Tok ("Language-Guided Transformer Tokenizer for Human Motion
//! Generation" and its code).
//!
//! The encoder reads `[text | latents | motion]` and keeps the rows of the latents, which begin as
//! learned vectors; its last layer is a convolution over neighbouring latents. The decoder begins with
//! one learned vector a frame, which attends to the other frames, to the latents and to the text. The
//! layers of each half are a U: what the first half of them gives is joined to the second half, the
//! last first.
//!
//! It differs from the published code in this: latents are as many as frames / 4 and not always 49;
//! each half projects the text by a layer of its own; latents of the decoder have learned positions,
//! since codes of one scale do not tell their place; text is packed and not padded, at the same
//! rotary index.
//!
//! Shapes: b clips, t latents and f frames of a clip, n rows of all clips, d width, c channels.

mod attention;
mod config;
mod decoder;
mod encoder;
mod layer;
mod linear;
mod packing;

pub use decoder::TransformerDecoder;
pub use encoder::TransformerEncoder;

#[cfg(test)]
mod tests;
