//! Predictions on one screen.

mod one;
mod quantity;
mod several;
mod words;

use super::Prediction;

pub(super) use quantity::QUANTITIES;
pub use quantity::cells;
pub use words::standing;
pub(super) use words::{distance, of_loss, span};

/// Predictions in some ten lines of at most 80 columns; [`text`](super::text()) has everything.
pub fn brief(predictions: &[Prediction]) -> String {
    match predictions {
        [] => String::new(),
        [one] => one::text(one),
        several => several::text(several),
    }
}
