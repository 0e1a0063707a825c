//! Predictions in words, for a terminal.

mod full;
mod one;
mod parts;
mod quantity;
mod several;
mod sized;

pub use full::{all_together, said};
pub use parts::standing;
pub use quantity::cells;
pub use sized::sized_text;

use crate::predict::Prediction;

/// Predictions in some ten lines of at most 80 columns; [`said`] has everything.
pub fn brief(predictions: &[Prediction]) -> String {
    match predictions {
        [] => String::new(),
        [one] => one::text(one),
        several => several::text(several),
    }
}
