//! MARDM's MotionCLIP, without its pretrained text: two transformers and symmetric InfoNCE.

mod contrast;
mod tower;
mod towers;

pub use towers::Towers;
