//! A framed data area with its two axes; everything in it is drawn in data coordinates.

use crate::laws::Coefficient;

use super::axis::{Axis, Direction, TICK_EM};
use super::legend::{Look, law_stroke};
use super::scene::{Anchor, Mark, Point, Scene, Stroke, plain_text};
use super::style::{FRAME, GRID, Rgb};

const TICK_LENGTH: f64 = 5.0;
/// How strongly an interval is tinted with its law's colour.
pub const BAND: f64 = 0.16;
/// Width of an error bar.
const BAR: f64 = 1.2;
const MINOR_TICK_LENGTH: f64 = 3.0;
/// Panels narrower than this have smaller marks.
const SMALL: f64 = 260.0;
/// Points of a curve, enough for half a pixel on a wide panel.
const CURVE_POINTS: usize = 120;

/// An upright rectangle in page pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Rect {
    pub fn width(&self) -> f64 {
        self.right - self.left
    }

    pub fn height(&self) -> f64 {
        self.bottom - self.top
    }

    pub fn centre(&self) -> Point {
        ((self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0)
    }
}

/// Both sides of a band along x.
type Band = Vec<(f64, [f64; 2])>;

/// The content of a panel in data coordinates: bands below the grid, lines and marks above it.
#[derive(Clone, Debug)]
pub struct Plot {
    /// The first line in bold.
    pub title: Vec<String>,
    pub x: Axis,
    pub y: Axis,
    bands: Vec<(Band, Rgb)>,
    items: Vec<Item>,
}

#[derive(Clone, Debug)]
enum Item {
    Line(Vec<Point>, Stroke),
    Mark(Point, Mark),
}

impl Plot {
    pub fn new(title: impl IntoIterator<Item = String>, x: Axis, y: Axis) -> Plot {
        let title = title.into_iter().collect();
        Plot { title, x, y, bands: Vec::new(), items: Vec::new() }
    }

    pub fn holds(&self, (x, y): Point) -> bool {
        self.x.holds(x) && self.y.holds(y)
    }

    /// A line through data points.
    pub fn line(&mut self, points: impl IntoIterator<Item = Point>, stroke: Stroke) {
        self.items.push(Item::Line(points.into_iter().collect(), stroke));
    }

    /// A function of x between two values of x.
    pub fn curve(&mut self, ends: [f64; 2], y_of_x: impl Fn(f64) -> f64, stroke: Stroke) {
        let [first, last] = ends.map(|x| self.x.share(x));
        let step = (last - first) / CURVE_POINTS as f64;
        let xs = (0..=CURVE_POINTS).map(|i| self.x.value(first + step * i as f64));
        let points: Vec<Point> = xs.map(|x| (x, y_of_x(x))).collect();
        self.line(points, stroke);
    }

    /// A marker at a data point; one outside the frame is not drawn.
    pub fn mark(&mut self, at: Point, mark: Mark) {
        self.items.push(Item::Mark(at, mark));
    }

    /// Markers at data points, all in one look.
    pub fn marks(&mut self, points: impl IntoIterator<Item = Point>, look: Look) {
        self.items.extend(points.into_iter().map(|at| Item::Mark(at, look.mark())));
    }

    /// Points joined by a line and marked, all in one look.
    pub fn series(&mut self, points: impl Iterator<Item = Point> + Clone, look: Look) {
        self.line(points.clone(), look.stroke());
        self.marks(points, look);
    }

    /// A bar of one standard error to either side of a point, if it is known.
    pub fn bar(&mut self, (x, y): Point, error: Option<f64>, colour: Rgb) {
        if let Some(error) = error {
            self.line([(x, y - error), (x, y + error)], Stroke::solid(colour, BAR));
        }
    }

    /// The line of a law along x, and the band of its intervals.
    pub fn law(&mut self, path: &[(f64, Coefficient)], colour: Rgb) {
        let known = path.iter().filter_map(|(x, own)| Some((*x, own.ci95?)));
        self.bands.push((known.collect(), colour.tint(BAND)));
        self.line(path.iter().map(|(x, own)| (*x, own.value)), law_stroke(colour));
    }
}

/// A plot with its place on the page.
#[derive(Clone, Debug)]
pub struct Panel {
    pub frame: Rect,
    pub plot: Plot,
    /// Whether tick labels are drawn below and to the left.
    pub x_labels: bool,
    pub y_labels: bool,
}

impl Panel {
    /// Everything but title and names of axes.
    pub fn draw(&self, scene: &mut Scene) {
        self.plot.bands.iter().for_each(|(sides, colour)| self.band(scene, sides, *colour));
        self.backdrop(scene);
        for item in &self.plot.items {
            match item {
                Item::Line(points, stroke) => self.line(scene, points, *stroke),
                Item::Mark(at, mark) => self.mark(scene, *at, *mark),
            }
        }
    }

    /// The page position of a value.
    fn at(&self, (x, y): Point) -> Point {
        let frame = &self.frame;
        let (x, y) = (self.plot.x.share(x), self.plot.y.share(y));
        (frame.left + x * frame.width(), frame.bottom - y * frame.height())
    }

    /// Grid, frame, ticks and their values.
    fn backdrop(&self, scene: &mut Scene) {
        let Rect { left, top, right, bottom } = self.frame;
        let (x_axis, y_axis) = (&self.plot.x, &self.plot.y);
        for tick in x_axis.ticks(self.frame.width(), Direction::Across) {
            let x = left + x_axis.share(tick.value) * self.frame.width();
            self.tick(scene, (x, bottom), (0.0, 1.0), (x, top), tick.label.as_deref());
        }
        for tick in y_axis.ticks(self.frame.height(), Direction::Up) {
            let y = bottom - y_axis.share(tick.value) * self.frame.height();
            self.tick(scene, (left, y), (-1.0, 0.0), (right, y), tick.label.as_deref());
        }
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        scene.line(&corners, Stroke::solid(FRAME, 1.0));
    }

    /// One tick: its mark, and if labelled its value and a grid line.
    fn tick(&self, scene: &mut Scene, at: Point, out: Point, far: Point, label: Option<&str>) {
        let length = if label.is_some() { TICK_LENGTH } else { MINOR_TICK_LENGTH };
        if label.is_some() {
            scene.line(&[at, far], Stroke::solid(GRID, 0.8));
        }
        let end = (at.0 + length * out.0, at.1 + length * out.1);
        scene.line(&[at, end], Stroke::solid(FRAME, 1.0));
        let (shown, place, anchor) = if out.1 > 0.0 {
            (self.x_labels, (at.0, at.1 + TICK_LENGTH + 13.0), Anchor::Middle)
        } else {
            (self.y_labels, (at.0 - TICK_LENGTH - 4.0, at.1 + 0.36 * TICK_EM), Anchor::End)
        };
        if let Some(label) = label.filter(|_| shown) {
            scene.text(plain_text(label, place, anchor, TICK_EM));
        }
    }

    /// A line through data points, cut at the frame.
    fn line(&self, scene: &mut Scene, points: &[Point], stroke: Stroke) {
        let placed: Vec<_> = points.iter().map(|&point| self.at(point)).collect();
        clipped(&placed, &self.frame).iter().for_each(|piece| scene.line(piece, stroke));
    }

    /// The area between the two sides, cut at the frame.
    fn band(&self, scene: &mut Scene, sides: &[(f64, [f64; 2])], colour: Rgb) {
        let inside = |x, y| {
            let (x, y) = self.at((x, y));
            (x, y.clamp(self.frame.top, self.frame.bottom))
        };
        let lower = sides.iter().map(|&(x, [low, _])| inside(x, low));
        let upper = sides.iter().rev().map(|&(x, [_, high])| inside(x, high));
        if !sides.is_empty() {
            scene.area(lower.chain(upper).collect(), colour);
        }
    }

    /// A marker at a data point; one outside the frame is not drawn.
    fn mark(&self, scene: &mut Scene, point: Point, mark: Mark) {
        let share = if self.frame.width() < SMALL { 0.75 } else { 1.0 };
        if self.plot.holds(point) {
            scene.mark(self.at(point), Mark { radius: mark.radius * share, ..mark });
        }
    }

    /// Lines of text above the frame, the lowest next to it.
    pub fn title(&self, scene: &mut Scene) {
        let lines = &self.plot.title;
        for (i, line) in lines.iter().enumerate() {
            let above = 7.0 + 16.0 * (lines.len() - 1 - i) as f64;
            let at = (self.frame.left, self.frame.top - above);
            let text = |em| plain_text(line, at, Anchor::Start, em);
            scene.text(if i == 0 { text(13.0).bold() } else { text(12.0) });
        }
    }
}

/// The pieces of a polyline inside a rectangle; points that are not finite break it.
fn clipped(points: &[Point], frame: &Rect) -> Vec<Vec<Point>> {
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    for pair in points.windows(2) {
        let Some((a, b)) = clip_segment(pair[0], pair[1], frame) else { continue };
        match pieces.last_mut() {
            Some(piece) if piece.last() == Some(&a) => piece.push(b),
            _ => pieces.push(vec![a, b]),
        }
    }
    pieces
}

/// Liang and Barsky (1984).
fn clip_segment(a: Point, b: Point, frame: &Rect) -> Option<(Point, Point)> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    if !(dx.is_finite() && dy.is_finite()) {
        return None;
    }
    let edges = [
        (-dx, a.0 - frame.left),
        (dx, frame.right - a.0),
        (-dy, a.1 - frame.top),
        (dy, frame.bottom - a.1),
    ];
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for (towards, room) in edges {
        match towards {
            0.0 if room < 0.0 => return None,
            0.0 => {}
            t if t < 0.0 => enter = enter.max(room / t),
            t => leave = leave.min(room / t),
        }
    }
    let on = |t: f64| if t == 1.0 { b } else { (a.0 + t * dx, a.1 + t * dy) };
    (enter < leave).then(|| (on(enter), on(leave)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Rect = Rect { left: 0.0, top: 0.0, right: 10.0, bottom: 10.0 };

    #[test]
    fn a_line_that_leaves_and_returns_is_two_pieces() {
        let line = [(2.0, 5.0), (5.0, -5.0), (8.0, 5.0)];
        let pieces = clipped(&line, &FRAME);
        assert_eq!(pieces, [vec![(2.0, 5.0), (3.5, 0.0)], vec![(6.5, 0.0), (8.0, 5.0)]]);
    }

    #[test]
    fn a_line_inside_stays_whole_and_one_outside_vanishes() {
        let inside = vec![(1.0, 1.0), (2.0, 9.0), (9.0, 3.0)];
        assert_eq!(clipped(&inside, &FRAME), std::slice::from_ref(&inside));
        assert!(clipped(&[(-5.0, 1.0), (-1.0, 9.0)], &FRAME).is_empty());
        assert!(clipped(&[(f64::NAN, 1.0), (1.0, 9.0)], &FRAME).is_empty());
    }
}
