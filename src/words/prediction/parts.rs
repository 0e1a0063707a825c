//! Words that predictions of one and of several budgets share.

use crate::laws::text::times;
use crate::predict::Prediction;
use crate::words::wrap;

/// Where a budget lies by the fitted ones, from its ratio to the largest and that of the smallest to it: before
/// "the fit" in a sentence.
pub(super) fn distance(beyond: f64, below: Option<f64>) -> String {
    match below {
        Some(factor) => format!("{} times below", times(factor)),
        None if beyond > 1.0 => format!("{} times beyond", times(beyond)),
        None => "within".to_string(),
    }
}

/// How far beyond the fit a prediction lies, and by which law it is.
pub fn standing(prediction: &Prediction) -> String {
    let far = distance(prediction.extrapolation_factor, prediction.below_fit);
    let law =
        prediction.recommended.map_or_else(String::new, |law| format!(", by {}", law.about()));
    format!("{far} the fit{law}")
}

/// Which loss a table's predictions are of, in parentheses; nothing for L_u and for a column `loss`.
pub(super) fn of_loss(name: Option<&str>) -> String {
    let named = |name| format!(" (loss: {name})");
    name.filter(|name| *name != "loss").map_or_else(String::new, named)
}

/// Sentences, and how many are left for `--full`.
pub(super) fn cautions(said: &[String], left: usize) -> String {
    let said: String = said.iter().map(|sentence| wrap("- ", sentence)).collect();
    if left == 0 { said } else { format!("{said}- {left} more: --full\n") }
}
