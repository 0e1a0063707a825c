//! The page of a figure: title and remarks above, panels below them, the legend to the right.

use super::legend::Legend;
use super::panel::{Panel, Plot, Rect};
use super::scene::{Anchor, Scene, Text, plain_text};
use super::style::{MUTED, Weight, wrap};

const MARGIN: f64 = 18.0;
const TITLE_EM: f64 = 17.0;
const REMARK_EM: f64 = 12.0;
const AXIS_EM: f64 = 13.0;
/// A row of tick labels below a panel, with the ticks.
const TICK_ROOM: f64 = 24.0;
/// The name of an axis, below the tick labels or left of them.
const NAME_ROOM: f64 = 24.0;

/// Everything on a page but the data.
#[derive(Clone, Debug)]
pub struct Page {
    pub width: f64,
    pub height: f64,
    pub title: String,
    /// Sentences below the title, wrapped.
    pub remarks: String,
    pub legend: Legend,
}

impl Page {
    /// Small multiples: all panels have the same axes, named once, valued on the outer sides.
    pub fn multiples(&self, plots: Vec<Plot>) -> Scene {
        let (mut scene, area, grid, left) = self.begin(&plots);
        let inner = Rect { left: area.left + left, bottom: area.bottom - NAME_ROOM, ..area };
        let is_even = grid.panels.is_multiple_of(grid.columns);
        let ragged = if is_even { 0.0 } else { TICK_ROOM };
        let gaps = Gaps { across: 24.0, down: 8.0 + ragged, below: TICK_ROOM, left: 0.0 };
        x_name(&mut scene, &plots[0].x.label, &inner, area.bottom);
        y_name(&mut scene, &plots[0].y.label, &inner, area.left);
        let panels = grid.panels(plots, &inner, gaps, true);
        panels.iter().for_each(|panel| panel.title(&mut scene));
        panels.iter().for_each(|panel| panel.draw(&mut scene));
        scene
    }

    /// Panels side by side, each with its own axes.
    pub fn panels(&self, plots: Vec<Plot>) -> Scene {
        let (mut scene, area, grid, left) = self.begin(&plots);
        let below = TICK_ROOM + NAME_ROOM;
        let gaps = Gaps { across: 16.0, down: 12.0, below, left };
        let panels = grid.panels(plots, &area, gaps, false);
        panels.iter().for_each(|panel| panel.title(&mut scene));
        for Panel { frame, plot, .. } in &panels {
            x_name(&mut scene, &plot.x.label, frame, frame.bottom + below);
            y_name(&mut scene, &plot.y.label, frame, frame.left - left);
        }
        panels.iter().for_each(|panel| panel.draw(&mut scene));
        scene
    }

    /// Writes title, remarks and legend; returns the area of the panels, their arrangement, and the space left of the
    /// outermost.
    fn begin(&self, plots: &[Plot]) -> (Scene, Rect, Grid, f64) {
        let mut scene = Scene::new(self.width, self.height);
        let mut lines = |text: &str, top, em, weight| {
            let width = self.width - 2.0 * MARGIN;
            let lines = text.lines().flat_map(|line| wrap(line, weight, em, width)).collect();
            let text = plain_text("", (MARGIN, top), Anchor::Start, em);
            let colour = if weight == Weight::Bold { text.colour } else { MUTED };
            scene.lines(lines, 1.4 * em, &Text { weight, colour, ..text })
        };
        let below_title = lines(&self.title, MARGIN, TITLE_EM, Weight::Bold);
        let top = lines(&self.remarks, below_title, REMARK_EM, Weight::Normal);
        let column = self.legend.width();
        let legend_left = self.width - MARGIN - column;
        let right = if column > 0.0 { legend_left - 20.0 } else { self.width - MARGIN };
        self.legend.draw(&mut scene, (legend_left, top + 12.0));
        // A long legend lengthens the page.
        scene.height = scene.height.max(top + 12.0 + self.legend.height() + MARGIN).ceil();
        let bottom = scene.height - MARGIN;
        let (area, grid) = (Rect { left: MARGIN, top: top + 10.0, right, bottom }, Grid::of(plots));
        let height = area.height() / grid.rows as f64;
        let widest = plots.iter().map(|plot| plot.y.label_width(height)).fold(0.0, f64::max);
        (scene, area, grid, NAME_ROOM + (widest.ceil() + 10.0))
    }
}

/// Space between panels, and inside each panel's cell below and left of its frame.
#[derive(Clone, Copy)]
struct Gaps {
    across: f64,
    down: f64,
    below: f64,
    left: f64,
}

/// Rows and columns of panels, filled row by row.
#[derive(Clone, Copy)]
struct Grid {
    panels: usize,
    columns: usize,
    rows: usize,
    /// Room for the tallest title of a panel.
    title: f64,
}

impl Grid {
    fn of(plots: &[Plot]) -> Grid {
        let panels = plots.len();
        let columns = match panels {
            0..=3 => panels,
            4 => 2,
            5..=9 => 3,
            _ => (panels as f64).sqrt().ceil() as usize,
        };
        let lines = plots.iter().map(|plot| plot.title.len()).max().unwrap_or(0);
        let title = if lines > 0 { 8.0 + 16.0 * lines as f64 } else { 0.0 };
        Grid { panels, columns, rows: panels.div_ceil(columns), title }
    }

    /// The panels in `area`; `shared` axes are valued on the outer sides only.
    fn panels(self, plots: Vec<Plot>, area: &Rect, gaps: Gaps, shared: bool) -> Vec<Panel> {
        let (last_below, below) = if shared { (gaps.below, 0.0) } else { (0.0, gaps.below) };
        let width = share(area.width(), self.columns, gaps.across);
        let height = share(area.height() - last_below, self.rows, gaps.down);
        let panel = |(i, plot)| {
            let (row, column) = (i / self.columns, i % self.columns);
            let left = area.left + column as f64 * (width + gaps.across);
            let top = area.top + row as f64 * (height + gaps.down);
            let (right, bottom) = (left + width, top + height - below);
            let frame = Rect { left: left + gaps.left, top: top + self.title, right, bottom };
            let x_labels = !shared || i + self.columns >= self.panels;
            Panel { frame, plot, x_labels, y_labels: !shared || column == 0 }
        };
        plots.into_iter().enumerate().map(panel).collect()
    }
}

/// The length of each of `n` parts with gaps between them.
fn share(length: f64, n: usize, gap: f64) -> f64 {
    (length - gap * (n - 1) as f64) / n as f64
}

fn x_name(scene: &mut Scene, name: &str, frame: &Rect, bottom: f64) {
    let at = (frame.centre().0, bottom - 5.0);
    scene.text(plain_text(name, at, Anchor::Middle, AXIS_EM));
}

fn y_name(scene: &mut Scene, name: &str, frame: &Rect, left: f64) {
    let at = (left + 0.9 * AXIS_EM, frame.centre().1);
    let text = plain_text(name, at, Anchor::Middle, AXIS_EM);
    scene.text(Text { upward: true, ..text });
}
