//! A figure as a list of shapes in page pixels, before any file format.
//!
//! The page's origin is its upper left corner; y grows downwards.

use super::style::{INK, Rgb, WHITE, Weight};

/// (x, y) in page pixels.
pub type Point = (f64, f64);

/// The alignment of a text at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    /// The share of a text that lies before its point.
    pub fn share(self) -> f64 {
        [0.0, 0.5, 1.0][self as usize]
    }
}

/// One line of text; its point lies on the baseline.
#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    pub content: String,
    pub at: Point,
    pub anchor: Anchor,
    pub em: f64,
    pub weight: Weight,
    pub colour: Rgb,
    /// Reads from bottom to top.
    pub upward: bool,
}

impl Text {
    pub fn coloured(self, colour: Rgb) -> Text {
        Text { colour, ..self }
    }

    pub fn bold(self) -> Text {
        Text { weight: Weight::Bold, ..self }
    }
}

/// Upright text in ink.
pub fn plain_text(content: &str, at: Point, anchor: Anchor, em: f64) -> Text {
    let (content, weight, colour) = (content.to_owned(), Weight::Normal, INK);
    Text { content, at, anchor, em, weight, colour, upward: false }
}

#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    Line { points: Vec<Point>, width: f64, colour: Rgb },
    Area { points: Vec<Point>, colour: Rgb },
    Disc { centre: Point, radius: f64, colour: Rgb },
    Text(Text),
}

/// Lengths of stroke and gap of a dashed line, in pixels.
const DASH: (f64, f64) = (7.0, 4.0);

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    pub colour: Rgb,
    pub width: f64,
    pub dashed: bool,
}

impl Stroke {
    pub fn solid(colour: Rgb, width: f64) -> Stroke {
        Stroke { colour, width, dashed: false }
    }

    pub fn dashed(self) -> Stroke {
        Stroke { dashed: true, ..self }
    }
}

/// Outlines that stay apart in grey; the first six mark series, the star marks a minimum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
    Down,
    Pentagon,
    Star,
}

impl Marker {
    /// The marker of the i-th series.
    pub fn nth(i: usize) -> Marker {
        use Marker::{Circle, Diamond, Down, Pentagon, Square, Triangle};
        [Circle, Square, Triangle, Diamond, Down, Pentagon][i % 6]
    }

    /// Corners on a circle of the given radius; sized so that all markers weigh alike.
    fn corners(self, (x, y): Point, radius: f64) -> Vec<Point> {
        let (n, turn, size) = match self {
            Marker::Circle => (0, 0.0, 1.0),
            Marker::Square => (4, 0.125, 1.22),
            Marker::Triangle => (3, 0.0, 1.3),
            Marker::Diamond => (4, 0.0, 1.3),
            Marker::Down => (3, 0.5, 1.3),
            Marker::Pentagon => (5, 0.0, 1.15),
            Marker::Star => (10, 0.0, 1.6),
        };
        let corner = |i: usize| {
            let inner = if self == Marker::Star && i % 2 == 1 { 0.45 } else { 1.0 };
            let angle = std::f64::consts::TAU * (i as f64 / n as f64 + turn);
            let reach = radius * size * inner;
            (x + reach * angle.sin(), y - reach * angle.cos())
        };
        (0..n).map(corner).collect()
    }
}

/// The style of a marker: hollow ones are flagged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    pub marker: Marker,
    pub colour: Rgb,
    pub radius: f64,
    pub hollow: bool,
}

/// Everything that a page shows, in drawing order.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    pub width: f64,
    pub height: f64,
    pub shapes: Vec<Shape>,
}

impl Scene {
    pub fn new(width: f64, height: f64) -> Scene {
        Scene { width, height, shapes: Vec::new() }
    }

    /// The page's own.
    pub fn corners(&self) -> [Point; 4] {
        let (w, h) = (self.width, self.height);
        [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)]
    }

    /// Strokes a line through the points, broken as the stroke says.
    pub fn line(&mut self, points: &[Point], stroke: Stroke) {
        let Stroke { colour, width, dashed } = stroke;
        let pieces = if dashed { dashes(points, DASH.0, DASH.1) } else { vec![points.to_vec()] };
        let long = pieces.into_iter().filter(|points| points.len() > 1);
        self.shapes.extend(long.map(|points| Shape::Line { points, width, colour }));
    }

    pub fn area(&mut self, points: Vec<Point>, colour: Rgb) {
        self.shapes.push(Shape::Area { points, colour });
    }

    /// Draws a marker with a white rim, so that neighbours stay apart.
    pub fn mark(&mut self, at: Point, mark: Mark) {
        self.marker_area(at, mark, mark.radius + 0.9, WHITE);
        self.marker_area(at, mark, mark.radius, mark.colour);
        if mark.hollow {
            self.marker_area(at, mark, mark.radius - 2.0, WHITE);
        }
    }

    fn marker_area(&mut self, centre: Point, mark: Mark, radius: f64, colour: Rgb) {
        self.shapes.push(match mark.marker {
            Marker::Circle => Shape::Disc { centre, radius, colour },
            other => Shape::Area { points: other.corners(centre, radius), colour },
        });
    }

    pub fn text(&mut self, text: Text) {
        self.shapes.push(Shape::Text(text));
    }

    /// Writes lines like `text`, `advance` pixels from each to the next, from its point downwards; returns where
    /// they end.
    pub fn lines(&mut self, lines: Vec<String>, advance: f64, text: &Text) -> f64 {
        let (left, mut y) = text.at;
        for content in lines {
            y += advance;
            self.text(Text { content, at: (left, y - 0.4 * text.em), ..text.clone() });
        }
        y
    }
}

/// Cuts a polyline into strokes of length `on`, `off` apart along its arc.
fn dashes(points: &[Point], on: f64, off: f64) -> Vec<Vec<Point>> {
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    let (mut drawing, mut left) = (false, 0.0);
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (length, mut done) = ((b.0 - a.0).hypot(b.1 - a.1), 0.0);
        while done + left < length {
            done += left;
            let share = done / length;
            let cut = (a.0 + (b.0 - a.0) * share, a.1 + (b.1 - a.1) * share);
            match pieces.last_mut() {
                Some(piece) if drawing => piece.push(cut),
                _ => pieces.push(vec![cut]),
            }
            drawing = !drawing;
            left = if drawing { on } else { off };
        }
        left -= length - done;
        if drawing && let Some(piece) = pieces.last_mut() {
            piece.push(b);
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_follow_the_arc_round_a_corner() {
        let pieces = dashes(&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)], 7.0, 4.0);
        assert_eq!(pieces[0], [(0.0, 0.0), (7.0, 0.0)]);
        // The second stroke runs from 11 to 18 along the arc, that is down the second side.
        assert_eq!(pieces[1], [(10.0, 1.0), (10.0, 8.0)]);
        assert_eq!(pieces.len(), 2);
    }

    #[test]
    fn hollow_markers_end_in_white() {
        let mut scene = Scene::new(10.0, 10.0);
        let mark = Mark { marker: Marker::Square, colour: Rgb(1, 2, 3), radius: 4.0, hollow: true };
        scene.mark((5.0, 5.0), mark);
        assert!(matches!(scene.shapes.last(), Some(Shape::Area { colour: WHITE, .. })));
    }
}
