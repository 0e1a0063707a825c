//! The loss of a model for a terminal.

use super::parts::{distance, of_loss};
use super::quantity::number;
use crate::laws::PerQuantity;
use crate::laws::text::{count, times};
use crate::predict::{SizedOptimum, SizedPrediction};
use crate::words::number::{four, from_to};
use crate::words::wrap;

/// The loss, the best model for the same FLOPs, and what lies between them, in at most 80 columns.
pub fn sized_text(prediction: &SizedPrediction) -> String {
    let SizedPrediction { ci95, optimum, .. } = prediction;
    title(prediction)
        + &row("loss", prediction.loss_normalised, four, ci95.loss_normalised)
        + "The best model for the same FLOPs, and how much this one loses by:\n"
        + &of_optimum(optimum)
        + &row("loss", optimum.loss_normalised, four, ci95.optimum_loss)
        + &row("lost", prediction.loss_above_optimum, four, ci95.loss_above_optimum)
        + &notes(prediction)
}

fn title(prediction: &SizedPrediction) -> String {
    let far = distance(prediction.extrapolation_factor, prediction.below_fit);
    let loss = of_loss(prediction.loss_name.as_deref());
    let sentence = format!(
        "{} on {} tokens, {} FLOPs, {far} the fit, by {} of {}{loss}:",
        model(prediction),
        count(tokens(&prediction.model)),
        count(prediction.flops),
        prediction.form,
        prediction.law
    );
    wrap("", &sentence)
}

/// The model's size under the names that the law knows.
fn model(prediction: &SizedPrediction) -> String {
    let named = prediction.model.named().filter(|(name, _)| *name != "D");
    named.map(|(name, x)| format!("{name} = {}", number(name)(*x))).collect::<Vec<_>>().join(", ")
}

fn of_optimum(optimum: &SizedOptimum) -> String {
    optimum.at.named().map(|(name, x)| row(name, *x, number(name), None)).collect()
}

fn row(name: &str, value: f64, number: fn(f64) -> String, interval: Option<[f64; 2]>) -> String {
    let ends = interval.map(|ends| format!("   95 %: {}", from_to(ends, number)));
    let ends = ends.unwrap_or_default();
    format!("  {name:<5}{:>11}{ends}\n", number(value))
}

fn notes(prediction: &SizedPrediction) -> String {
    let tokens = tokens(&prediction.model) / tokens(&prediction.optimum.at);
    let trained = if tokens > 1.0 {
        format!("It is trained on {} times the best model's tokens", times(tokens))
    } else {
        format!("It is trained on {} of the best model's tokens", times(tokens))
    };
    let equal = prediction.flops_of_equal_loss.map_or_else(String::new, |flops| {
        let share = 100.0 * flops / prediction.flops;
        format!("; the best model reaches its loss with {} % of the FLOPs", times(share))
    });
    let first = format!("{trained}{equal}.");
    let sentences = [first].into_iter().chain(prediction.warnings.iter().cloned());
    sentences.map(|sentence| wrap("- ", &sentence)).collect()
}

/// D, which a model on some tokens always has.
fn tokens(of: &PerQuantity<f64>) -> f64 {
    of.tokens.unwrap_or(f64::NAN)
}
