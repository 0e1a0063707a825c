//! The loss of a model for a terminal.

use super::types::{SizedOptimum, SizedPrediction};
use crate::laws::text::{count, times, wrap};
use crate::predict::brief::{distance, of_loss};

/// The loss, the best model for the same FLOPs, and what lies between them, in at most 80 columns.
pub fn sized_text(prediction: &SizedPrediction) -> String {
    let SizedPrediction { ci95, optimum, .. } = prediction;
    title(prediction)
        + &row("loss", Some(prediction.loss_normalised), loss, ci95.loss_normalised)
        + "The best model for the same FLOPs, and how much this one loses by:\n"
        + &of_optimum(optimum)
        + &row("loss", Some(optimum.loss_normalised), loss, ci95.optimum_loss)
        + &row("lost", Some(prediction.loss_above_optimum), loss, ci95.loss_above_optimum)
        + &notes(prediction)
}

fn title(prediction: &SizedPrediction) -> String {
    let far = distance(prediction.extrapolation_factor, prediction.below_fit);
    let loss = of_loss(prediction.loss_name.as_deref());
    let sentence = format!(
        "{} on {} tokens, {} FLOPs, {far} the fit, by {} of {}{loss}:",
        model(prediction),
        count(prediction.tokens),
        count(prediction.flops),
        prediction.form,
        prediction.law
    );
    wrap("", &sentence)
}

/// The model's size under the names that the law knows.
fn model(prediction: &SizedPrediction) -> String {
    let sizes = [
        ("N", prediction.params),
        ("N_nv", prediction.params_nonvocab),
        ("N_v", prediction.params_vocab),
    ];
    let told = sizes.iter().filter_map(|(name, x)| Some(format!("{name} = {}", count((*x)?))));
    let codes = prediction.n_vocab.map(|n_vocab| format!("V = {n_vocab:.0}"));
    told.chain(codes).collect::<Vec<_>>().join(", ")
}

fn of_optimum(optimum: &SizedOptimum) -> String {
    row("N", optimum.params, count, None)
        + &row("N_nv", optimum.params_nonvocab, count, None)
        + &row("N_v", optimum.params_vocab, count, None)
        + &row("V", optimum.n_vocab, |x| format!("{x:.0}"), None)
        + &row("D", Some(optimum.tokens), count, None)
}

fn loss(x: f64) -> String {
    format!("{x:.4}")
}

fn row(
    name: &str,
    value: Option<f64>,
    number: fn(f64) -> String,
    interval: Option<[f64; 2]>,
) -> String {
    let Some(value) = value else { return String::new() };
    let ends = interval.map(|ends| ends.map(number));
    let ends = ends.map_or(String::new(), |[low, high]| format!("   95 %: {low} to {high}"));
    format!("  {name:<5}{:>11}{ends}\n", number(value))
}

fn notes(prediction: &SizedPrediction) -> String {
    let tokens = prediction.tokens / prediction.optimum.tokens;
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
