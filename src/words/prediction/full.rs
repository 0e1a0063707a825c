//! A prediction for a terminal.

use super::brief;
use super::parts::of_loss;
use super::quantity::{QUANTITIES, number};
use crate::laws::text::count;
use crate::predict::{Prediction, Together};
use crate::words::number::{four, known, span};
use crate::words::{listed, wrap};

/// Predictions on one screen, or all that is known of each.
pub fn said(predictions: &[Prediction], full: bool) -> String {
    match full {
        true => predictions.iter().map(text).collect::<Vec<_>>().join("\n"),
        false => brief(predictions),
    }
}

/// The prediction in at most 80 columns and without colour.
pub fn text(prediction: &Prediction) -> String {
    let head =
        format!("\n{:<8}{:>14}{:>28}{:>14}\n", "", "on budget", "95 % interval", "by itself");
    wrap("", &title(prediction))
        + &head
        + &rows(prediction)
        + &shape(prediction)
        + &together(prediction)
        + &listed("warnings", prediction.warnings.iter().cloned())
}

fn title(prediction: &Prediction) -> String {
    format!(
        "Optimum for {} FLOPs by {}{}: each law by itself, they would spend {:.3} of it; extrapolation factor {:.3}.",
        count(prediction.budget_flops),
        prediction.law,
        of_loss(prediction.loss_name.as_deref()),
        prediction.budget_ratio,
        prediction.extrapolation_factor
    )
}

fn rows(prediction: &Prediction) -> String {
    let Prediction { at, ci95, raw, .. } = prediction;
    let row = |(name, value): (&str, &f64)| {
        let number = number(name);
        let interval = span(ci95.at.of(name).copied(), number);
        let raw = known(raw.at.of(name).copied(), count);
        format!("{name:<8}{:>14}{interval:>28}{raw:>14}\n", number(*value))
    };
    at.named().map(row).collect::<String>() + &loss(prediction)
}

fn loss(prediction: &Prediction) -> String {
    let Some(loss) = prediction.loss_normalised else {
        return String::new();
    };
    // Where there is no log law, the loss is the floor law's already.
    let both = prediction.raw.loss_log.and(prediction.raw.loss_floor);
    let floor = both.map_or_else(String::new, |floor| {
        let interval = span(prediction.ci95.loss_floor, four);
        format!("{:<8}{:>14}{interval:>28}   by the law with a floor\n", "", four(floor))
    });
    let interval = span(prediction.ci95.loss_normalised, four);
    let others = prediction.ci95.loss_on_other_clips.map_or_else(String::new, |interval| {
        format!("{:<22}{:>28}\n", "on other clips", span(Some(interval), four))
    });
    format!("{:<8}{:>14}{interval:>28}\n{others}{floor}", "loss", four(loss))
}

fn shape(prediction: &Prediction) -> String {
    let Some(shape) = &prediction.shape else {
        return String::new();
    };
    let levels = match &shape.levels[..] {
        [] => String::new(),
        levels => format!(" (FSQ levels {levels:?})"),
    };
    let sentence = format!(
        "nearest shape: {} layers, {} heads, width {}, vocabulary {}{levels}",
        shape.n_layer, shape.n_head, shape.d_model, shape.n_vocab
    );
    format!("\n{}", wrap("", &sentence))
}

/// What all laws say together.
fn together(prediction: &Prediction) -> String {
    let together = prediction.together.as_ref();
    together.map_or_else(String::new, |together| wrap("- ", &all_together(together)))
}

/// What all laws say together, in a sentence.
pub fn all_together(together: &Together) -> String {
    let Together { laws, loss_normalised, at } = together;
    let said = QUANTITIES.into_iter().filter_map(|(name, number)| {
        let value = if name == "loss" { *loss_normalised } else { *at.of(name)? };
        Some(format!("{name} {}", number(value)))
    });
    let weights = laws.iter().map(|one| format!("{} {:.2}", one.law.name(), one.weight));
    format!(
        "The laws together, weighed by how little they missed ({}): {}.",
        weights.collect::<Vec<_>>().join(", "),
        said.collect::<Vec<_>>().join(", ")
    )
}
