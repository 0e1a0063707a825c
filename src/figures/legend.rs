//! Styles of the series of a figure, and their legend in a column right of the data.

use super::axis::scientific;
use super::cells::ModelSize;
use super::scene::{Anchor, Mark, Marker, Point, Scene, Stroke, plain_text};
use super::style::{MUTED, Rgb, Weight, categories, measure, ordered};

const EM: f64 = 12.0;
const ROW: f64 = 20.0;
const SWATCH: f64 = 30.0;

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

/// The line of a bound.
pub fn bound_stroke() -> Stroke {
    Stroke::solid(MUTED, 1.3).dashed()
}

/// The line of a law.
pub fn law_stroke(colour: Rgb) -> Stroke {
    Stroke::solid(colour, 2.0)
}

/// The sample next to a legend's text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sample {
    Line(Stroke),
    Mark(Mark),
    MarkedLine(Stroke, Mark),
    Band(Rgb),
}

#[derive(Clone, Debug, PartialEq)]
enum Row {
    Heading(String),
    Entry(Sample, String),
}

/// Headed groups of samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Legend {
    rows: Vec<Row>,
}

impl Legend {
    /// One that begins with a heading.
    pub fn headed(text: &str) -> Legend {
        Legend { rows: vec![Row::Heading(text.to_owned())] }
    }

    pub fn heading(&mut self, text: &str) {
        self.rows.push(Row::Heading(text.to_owned()));
    }

    pub fn entry(&mut self, sample: Sample, text: impl Into<String>) {
        self.rows.push(Row::Entry(sample, text.into()));
    }

    /// Lists the models by their sizes, which have a symbol.
    pub fn models(symbol: &str, models: &[ModelSize], looks: &[Look]) -> Legend {
        let mut legend = Legend::headed(&format!("Model, by {symbol}"));
        let both = models.iter().zip(looks);
        both.for_each(|(model, look)| legend.entry(look.sample(), model.label()));
        legend
    }

    /// Lists the budgets, marking the one that the laws did not see.
    pub fn budgets(
        &mut self,
        budgets: &[f64],
        looks: &[Look],
        held_out: Option<f64>,
        sample: fn(Look) -> Sample,
    ) {
        self.heading("Budget C (FLOPs)");
        for (&budget, &look) in budgets.iter().zip(looks) {
            let held = if held_out == Some(budget) { ", held out" } else { "" };
            self.entry(sample(look), format!("{}{held}", scientific(budget)));
        }
    }

    /// The column's width in pixels, 0 when it is empty.
    pub fn width(&self) -> f64 {
        let row = |row: &Row| match row {
            Row::Heading(text) => measure(text, Weight::Bold, EM),
            Row::Entry(_, text) => SWATCH + 8.0 + measure(text, Weight::Normal, EM),
        };
        self.rows.iter().map(row).fold(0.0, f64::max).ceil()
    }

    /// The column's height in pixels.
    pub fn height(&self) -> f64 {
        self.rows.iter().enumerate().map(|(i, row)| advance(i, row)).sum()
    }

    pub fn draw(&self, scene: &mut Scene, (left, top): Point) {
        let mut y = top;
        for (i, row) in self.rows.iter().enumerate() {
            y += advance(i, row);
            match row {
                Row::Heading(text) => {
                    scene.text(plain_text(text, (left, y), Anchor::Start, EM).bold());
                }
                Row::Entry(sample, text) => entry(scene, *sample, text, (left, y)),
            }
        }
    }
}

/// Distance from the baseline of the previous row: headings have extra space above.
fn advance(i: usize, row: &Row) -> f64 {
    match row {
        Row::Heading(_) if i > 0 => 1.5 * ROW,
        _ => ROW,
    }
}

fn entry(scene: &mut Scene, sample: Sample, text: &str, (left, baseline): Point) {
    let y = baseline - 0.36 * EM;
    let right = left + SWATCH;
    if let Sample::Line(stroke) | Sample::MarkedLine(stroke, _) = sample {
        scene.line(&[(left, y), (right, y)], stroke);
    }
    if let Sample::Mark(mark) | Sample::MarkedLine(_, mark) = sample {
        scene.mark((left + SWATCH / 2.0, y), mark);
    }
    if let Sample::Band(colour) = sample {
        let (top, bottom) = (y - 6.0, y + 6.0);
        scene.area(vec![(left, top), (right, top), (right, bottom), (left, bottom)], colour);
    }
    scene.text(plain_text(text, (right + 8.0, baseline), Anchor::Start, EM));
}
