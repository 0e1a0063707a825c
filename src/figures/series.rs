//! Looks of the series of a figure, and the rows of the legend that explain them.

use super::cells::ModelSize;
use super::colour::{MUTED, Rgb, categories, ordered};
use super::legend::{Legend, Sample};
use super::scene::{Mark, Marker, Stroke};
use super::ticks::scientific;

/// Colour and marker of one series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    pub colour: Rgb,
    pub marker: Marker,
}

impl Look {
    pub fn stroke(self) -> Stroke {
        Stroke::solid(self.colour, 1.6)
    }

    pub fn mark(self) -> Mark {
        Mark { marker: self.marker, colour: self.colour, radius: 4.0, hollow: false }
    }

    pub fn sample(self) -> Sample {
        Sample::MarkedLine(self.stroke(), self.mark())
    }
}

/// Looks for `n` things without an order, such as models or kinds of tokenizer.
pub fn category_looks(n: usize) -> Vec<Look> {
    looks(categories(n))
}

/// Looks for `n` things with an order, such as budgets.
pub fn ordered_looks(n: usize) -> Vec<Look> {
    looks(ordered(n))
}

fn looks(colours: Vec<Rgb>) -> Vec<Look> {
    let look = |(i, colour)| Look { colour, marker: Marker::nth(i) };
    colours.into_iter().enumerate().map(look).collect()
}

/// Lists the models by their sizes, which have a symbol.
pub fn explain_models(legend: &mut Legend, symbol: &str, models: &[ModelSize], looks: &[Look]) {
    legend.heading(&format!("Model, by {symbol}"));
    for (model, look) in models.iter().zip(looks) {
        legend.entry(look.sample(), model.label());
    }
}

/// Lists the budgets, marking the one that the laws did not see.
pub fn explain_budgets(
    legend: &mut Legend,
    budgets: &[f64],
    looks: &[Look],
    held_out: Option<f64>,
    sample: fn(Look) -> Sample,
) {
    legend.heading("Budget C (FLOPs)");
    for (&budget, &look) in budgets.iter().zip(looks) {
        let held = if held_out == Some(budget) { ", held out" } else { "" };
        legend.entry(sample(look), format!("{}{held}", scientific(budget)));
    }
}

/// The line of a bound.
pub fn bound_stroke() -> Stroke {
    Stroke::solid(MUTED, 1.3).dashed()
}

/// The line of a law.
pub fn law_stroke(colour: Rgb) -> Stroke {
    Stroke::solid(colour, 2.0)
}
