//! Predictions on one screen.

use super::{one, several};
use crate::predict::Prediction;

/// Predictions in some ten lines of at most 80 columns; [`full`](super::full::text) has everything.
pub fn brief(predictions: &[Prediction]) -> String {
    match predictions {
        [] => String::new(),
        [one] => one::text(one),
        several => several::text(several),
    }
}
