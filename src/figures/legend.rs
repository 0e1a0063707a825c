//! What marks and lines mean, in a column right of the data.

use super::colour::Rgb;
use super::font::{Weight, measure};
use super::scene::{Anchor, Mark, Point, Scene, Stroke, Text, plain_text};

const EM: f64 = 12.0;
const ROW: f64 = 20.0;
const SWATCH: f64 = 30.0;

/// The sample beside a legend's text.
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
    pub fn heading(&mut self, text: &str) {
        self.rows.push(Row::Heading(text.to_owned()));
    }

    pub fn entry(&mut self, sample: Sample, text: impl Into<String>) {
        self.rows.push(Row::Entry(sample, text.into()));
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
                Row::Heading(text) => heading(scene, text, (left, y)),
                Row::Entry(sample, text) => entry(scene, *sample, text, (left, y)),
            }
        }
    }
}

/// From the baseline of the row before to that of this one: a heading has air above it.
fn advance(i: usize, row: &Row) -> f64 {
    match row {
        Row::Heading(_) if i > 0 => 1.5 * ROW,
        _ => ROW,
    }
}

fn heading(scene: &mut Scene, text: &str, at: Point) {
    scene.text(Text { weight: Weight::Bold, ..plain_text(text, at, Anchor::Start, EM) });
}

fn entry(scene: &mut Scene, sample: Sample, text: &str, (left, baseline): Point) {
    let y = baseline - 0.36 * EM;
    let (from, to) = ((left, y), (left + SWATCH, y));
    let middle = (left + SWATCH / 2.0, y);
    match sample {
        Sample::Line(stroke) => scene.line(&[from, to], stroke),
        Sample::Mark(mark) => scene.mark(middle, mark),
        Sample::MarkedLine(stroke, mark) => {
            scene.line(&[from, to], stroke);
            scene.mark(middle, mark);
        }
        Sample::Band(colour) => {
            let (top, bottom) = (y - 6.0, y + 6.0);
            scene.area(vec![(left, top), (to.0, top), (to.0, bottom), (left, bottom)], colour);
        }
    }
    scene.text(plain_text(text, (left + SWATCH + 8.0, baseline), Anchor::Start, EM));
}
