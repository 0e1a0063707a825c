//! Predictions in words, for a terminal.

mod brief;
mod full;
mod one;
mod parts;
mod quantity;
mod several;
mod sized;

pub use brief::brief;
pub use full::{all_together, said};
pub use parts::standing;
pub use quantity::cells;
pub use sized::sized_text;
