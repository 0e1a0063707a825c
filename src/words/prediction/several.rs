//! Predictions for several budgets: a table, and what the farthest is warned of.

use super::parts::{cautions, distance, of_loss};
use super::quantity::{QUANTITIES, values};
use crate::laws::text::{count, short};
use crate::predict::Prediction;
use crate::words::number::{span, thousandths};
use crate::words::wrap;

pub(super) fn text(predictions: &[Prediction]) -> String {
    title(predictions)
        + &head(predictions)
        + &predictions.iter().map(rows).collect::<String>()
        + &notes(predictions)
}

fn title(predictions: &[Prediction]) -> String {
    let law = predictions[0].recommended;
    let by = law.map_or_else(String::new, |law| format!(" by {}", law.about()));
    let loss = of_loss(predictions[0].loss_name.as_deref());
    wrap("", &format!("Optima{by}, and how far beyond the fit they lie{loss}:"))
}

fn head(predictions: &[Prediction]) -> String {
    let told = QUANTITIES.into_iter().zip(values(&predictions[0]));
    line("FLOPs", told.map(|((name, _), (value, _))| value.map(|_| name.to_string())))
}

/// The values of a budget, and below them their intervals.
fn rows(prediction: &Prediction) -> String {
    let numbers = numbers();
    let values = values(prediction);
    let told = numbers.into_iter().zip(values);
    let own = told.clone().map(|(number, (value, _))| value.map(number));
    let intervals = told.map(|(number, (value, ends))| value.map(|_| span(ends, number)));
    let far = distance(prediction.extrapolation_factor, prediction.below_fit);
    let far = format!("  {}", far.trim_end_matches(" beyond"));
    line(&count(prediction.budget_flops), own) + &line(&far, intervals)
}

/// How the quantities are written in a column.
fn numbers() -> [fn(f64) -> String; 5] {
    let [_, _, (_, vocab), _, _] = QUANTITIES;
    let narrow = |x| short(x, 2);
    [narrow, narrow, vocab, narrow, thousandths]
}

/// A label and a column for each quantity that there is.
fn line(label: &str, cells: impl Iterator<Item = Option<String>>) -> String {
    let cells: String = cells.flatten().map(|cell| format!(" {cell:>15}")).collect();
    format!("{label:<16}{cells}").trim_end().to_string() + "\n"
}

/// The weightiest warning of the farthest budget, and how many there are besides.
fn notes(predictions: &[Prediction]) -> String {
    let all: usize = predictions.iter().map(|prediction| prediction.warnings.len()).sum();
    let farthest = predictions.iter().max_by(|a, b| a.budget_flops.total_cmp(&b.budget_flops));
    let said = farthest.and_then(|one| Some((one.budget_flops, one.warnings.first()?)));
    let said = said.map(|(budget, warning)| format!("{}: {warning}", count(budget)));
    let said: Vec<String> = said.into_iter().collect();
    cautions(&said, all - said.len())
}
