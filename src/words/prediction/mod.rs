//! Predictions as text for a terminal: for budgets in `budgets`, for one model here.

mod budgets;

pub use budgets::{all_together, said};

use super::{four, from_to, wrap};
use crate::laws::PerQuantity;
use crate::laws::text::{count, times};
use crate::predict::{PredictedShape, Prediction, SizedPrediction};

/// The symbol of a quantity, and the format of its values.
type Quantity = (&'static str, fn(f64) -> String);

/// N, N_nv, V, D and the loss.
const QUANTITIES: [Quantity; 5] =
    [("N", count), ("N_nv", count), ("V", |x| format!("{x:.0}")), ("D", count), ("loss", four)];

/// The format of a quantity's values; N_v like N.
fn number(symbol: &str) -> fn(f64) -> String {
    let own = QUANTITIES.into_iter().find(|(name, _)| *name == symbol);
    own.map_or(count, |(_, number)| number)
}

/// The values of a prediction with their 95 % intervals, in the order of [`QUANTITIES`].
fn values(prediction: &Prediction) -> [(Option<f64>, Option<[f64; 2]>); 5] {
    QUANTITIES.map(|(name, _)| match name {
        "loss" => (prediction.loss_normalised, prediction.ci95.loss_normalised),
        _ => (prediction.at.of(name).copied(), prediction.ci95.at.of(name).copied()),
    })
}

/// Each quantity of the prediction with its value and its 95 % interval, as on a screen, and the interval of
/// the loss on other clips if it is known.
pub fn cells(prediction: &Prediction) -> Vec<[String; 3]> {
    let row = |((name, number), (value, interval)): (Quantity, (Option<f64>, Option<[f64; 2]>))| {
        let interval = interval.map_or_else(String::new, |ends| from_to(ends, number));
        Some([name.to_string(), number(value?), interval])
    };
    let own = QUANTITIES.into_iter().zip(values(prediction)).filter_map(row);
    let others = on_other_clips(prediction);
    own.chain(others.map(|told| ["loss on other clips".into(), String::new(), told])).collect()
}

/// The interval of the loss on other held-out clips.
fn on_other_clips(prediction: &Prediction) -> Option<String> {
    prediction.ci95.loss_on_other_clips.map(|ends| from_to(ends, four))
}

/// The nearest model that can be built, in a few words.
pub fn buildable(shape: &PredictedShape) -> String {
    format!(
        "{} layers, {} heads, width {}, {} codes",
        shape.n_layer, shape.n_head, shape.d_model, shape.n_vocab
    )
}

/// The distance of a budget from the fitted ones, to stand before "the fit". `beyond`: the budget over the
/// largest fitted one; `below`: the smallest fitted one over the budget.
fn distance(beyond: f64, below: Option<f64>) -> String {
    match below {
        Some(factor) => format!("{} times below", times(factor)),
        None if beyond > 1.0 => format!("{} times beyond", times(beyond)),
        None => "within".to_string(),
    }
}

/// The distance of a prediction from the fit, and its law.
pub fn standing(prediction: &Prediction) -> String {
    let far = distance(prediction.extrapolation_factor, prediction.below_fit);
    let law =
        prediction.recommended.map_or_else(String::new, |law| format!(", by {}", law.about()));
    format!("{far} the fit{law}")
}

/// The name of a table's loss, in parentheses; empty for L_u and for a column `loss`.
fn of_loss(name: Option<&str>) -> String {
    let named = |name| format!(" (loss: {name})");
    name.filter(|name| *name != "loss").map_or_else(String::new, named)
}

// The loss of a model of any size.

/// The loss, the best model for the same FLOPs and the gap between them, in at most 80 columns.
pub fn sized_text(prediction: &SizedPrediction) -> String {
    let SizedPrediction { ci95, optimum, .. } = prediction;
    let of_optimum = optimum.at.named().map(|(name, x)| row(name, *x, number(name), None));
    title(prediction)
        + &row("loss", prediction.loss_normalised, four, ci95.loss_normalised)
        + "The best model for the same FLOPs, and the loss above it:\n"
        + &of_optimum.collect::<String>()
        + &row("loss", optimum.loss_normalised, four, ci95.optimum_loss)
        + &row("above", prediction.loss_above_optimum, four, ci95.loss_above_optimum)
        + &notes(prediction)
}

fn title(prediction: &SizedPrediction) -> String {
    // The model's size in the quantities of the law.
    let named = prediction.model.named().filter(|(name, _)| *name != "D");
    let size: Vec<_> = named.map(|(name, x)| format!("{name} = {}", number(name)(*x))).collect();
    let sentence = format!(
        "{} on {} tokens, {} FLOPs, {} the fit, by {} of {}{}:",
        size.join(", "),
        count(tokens(&prediction.model)),
        count(prediction.flops),
        distance(prediction.extrapolation_factor, prediction.below_fit),
        prediction.form,
        prediction.law,
        of_loss(prediction.loss_name.as_deref())
    );
    wrap("", &sentence)
}

fn row(name: &str, value: f64, number: fn(f64) -> String, interval: Option<[f64; 2]>) -> String {
    let ends = interval.map(|ends| format!("   95 %: {}", from_to(ends, number)));
    format!("  {name:<5}{:>11}{}\n", number(value), ends.unwrap_or_default())
}

fn notes(prediction: &SizedPrediction) -> String {
    let ratio = tokens(&prediction.model) / tokens(&prediction.optimum.at);
    let more = if ratio > 1.0 { "times" } else { "of" };
    let equal = prediction.flops_of_equal_loss.map_or_else(String::new, |flops| {
        let share = 100.0 * flops / prediction.flops;
        format!("; the best model reaches its loss with {} % of the FLOPs", times(share))
    });
    let trained =
        format!("It is trained on {} {more} the best model's tokens{equal}.", times(ratio));
    let sentences = [trained].into_iter().chain(prediction.warnings.iter().cloned());
    sentences.map(|sentence| wrap("- ", &sentence)).collect()
}

/// D, always known here.
fn tokens(of: &PerQuantity<f64>) -> f64 {
    of.tokens.unwrap_or(f64::NAN)
}
