//! Predictions on one screen.

mod one;
mod quantity;
mod several;

use super::Prediction;
use crate::laws::text::{times, wrap};

pub(super) use quantity::QUANTITIES;
pub use quantity::cells;

/// Predictions in some ten lines of at most 80 columns; [`text`](super::text()) has everything.
pub fn brief(predictions: &[Prediction]) -> String {
    match predictions {
        [] => String::new(),
        [one] => one::text(one),
        several => several::text(several),
    }
}

/// How far beyond the fit a prediction lies, and by which law it is.
pub fn standing(prediction: &Prediction) -> String {
    let far = match prediction.extrapolation_factor {
        factor if factor > 1.0 => format!("{} times beyond the fit", times(factor)),
        _ => "within the fit".to_string(),
    };
    let law =
        prediction.recommended.map_or_else(String::new, |law| format!(", by {}", law.about()));
    far + &law
}

/// Sentences, and how many are left for `--full`.
fn cautions(said: &[String], left: usize) -> String {
    let said: String = said.iter().map(|sentence| wrap("- ", sentence)).collect();
    if left == 0 { said } else { format!("{said}- {left} more: --full\n") }
}
