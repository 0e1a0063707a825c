//! The contact sheet: one row per motion, its poses at equal intervals from left to right.

use image::RgbImage;

use super::marks::{self, HEAD_RADIUS, REACH, facts, far_to_near, head};
use super::room::{Bounds, Segment, View, not_drawn, patch, path, see, within};
use crate::figures::formats::{self, DrawError, raster};
use crate::figures::scene::{Anchor, Point, Scene, Shape, Stroke, plain_text};
use crate::figures::style::{GRID, INK, MUTED, Rgb, WHITE, Weight, measure};
use crate::motion::Pose;

/// Poses of a row.
const COLUMNS: usize = 8;
const CELL_WIDTH: f64 = 132.0;
/// The tallest picture of a pose, page pixels.
const CELL_HEIGHT: f64 = 170.0;
const MARGIN: f64 = 18.0;
const WIDTH: f64 = 2.0 * MARGIN + CELL_WIDTH * COLUMNS as f64;
const TITLE_EM: f64 = 14.0;
const LABEL_EM: f64 = 11.0;
/// Ground is drawn this far round the root, metres.
const GROUND_RADIUS: f64 = 0.55;
/// White on either side of a line, page pixels: a near limb cuts a far one.
const HALO: f64 = 1.2;

/// The content of a row: at least one pose.
pub struct Row<'a> {
    pub poses: Vec<Pose>,
    pub fps: f32,
    pub caption: &'a str,
}

/// The PNG of at least one motion; all bodies are drawn to one scale.
pub fn png(rows: &[Row]) -> Result<Vec<u8>, DrawError> {
    let bounds = rows.iter().map(cell_bounds).reduce(Bounds::with);
    let bounds = bounds.ok_or("a sheet needs a motion")?;
    // The legend above the rows.
    let mut header = Scene::new(WIDTH, MARGIN + LABEL_EM);
    marks::sides(&mut header, (MARGIN, MARGIN), LABEL_EM);
    let mut sheet = raster(&header)?;
    // Row by row: a whole sheet in the renderer's fine pixels would fill the memory.
    for row in rows {
        let row = raster(&row.scene(bounds))?;
        let (width, height) = (sheet.width(), sheet.height() + row.height());
        let samples = [sheet.into_raw(), row.into_raw()].concat();
        sheet = RgbImage::from_raw(width, height, samples).ok_or("rows differ in width")?;
    }
    formats::png(&sheet)
}

/// The poses that a row shows: the first, the last, and others at even times between them.
fn shown(n_poses: usize) -> Vec<usize> {
    let n = COLUMNS.min(n_poses);
    let last = (n.max(2) - 1) as f64;
    (0..n).map(|i| ((n_poses - 1) as f64 * i as f64 / last).round() as usize).collect()
}

/// The bounding rectangle of all shown poses with their roots in the middle of the ground.
fn cell_bounds(row: &Row) -> Bounds {
    let n_shown = if not_drawn(&row.poses).is_some() { 0 } else { row.poses.len() };
    let poses = shown(n_shown).into_iter().map(|frame| &row.poses[frame]);
    let joints = poses.flat_map(|pose| {
        let [x, _, z] = pose[0].map(f64::from);
        let joints = pose.iter().map(|joint| joint.map(f64::from));
        joints.map(move |joint| see([joint[0] - x, joint[1], joint[2] - z]))
    });
    let reach = GROUND_RADIUS;
    let rim = [[reach, 0.0, 0.0], [-reach, 0.0, 0.0], [0.0, 0.0, reach], [0.0, 0.0, -reach]];
    Bounds::of(joints).wider(REACH).with(Bounds::of(rim.into_iter().map(see)))
}

impl Row<'_> {
    fn scene(&self, bounds: Bounds) -> Scene {
        let mut scene = Scene::new(WIDTH, 0.0);
        let reason = not_drawn(&self.poses);
        let is_drawn = reason.is_none();
        let facts = reason.unwrap_or_else(|| facts(&self.poses, self.fps));
        let top = self.title(&mut scene, &facts);
        if !is_drawn {
            scene.height = (top + MARGIN / 2.0).ceil();
            return scene;
        }
        let scale = (CELL_WIDTH / bounds.width()).min(CELL_HEIGHT / bounds.height());
        let height = scale * bounds.height();
        let middle = (bounds.left + bounds.right) / 2.0;
        for (column, frame) in shown(self.poses.len()).into_iter().enumerate() {
            let centre = MARGIN + CELL_WIDTH * (column as f64 + 0.5);
            let corner = (centre - scale * middle, top + scale * bounds.top);
            self.cell(&mut scene, frame, scale, corner);
            let seconds = format!("{:.1} s", frame as f64 / f64::from(self.fps));
            let at = (centre, top + height + 1.1 * LABEL_EM);
            scene.text(plain_text(&seconds, at, Anchor::Middle, LABEL_EM).coloured(MUTED));
        }
        scene.height = (top + height + 2.0 * LABEL_EM + MARGIN / 2.0).ceil();
        scene
    }

    /// Writes caption and facts; returns where they end.
    fn title(&self, scene: &mut Scene, facts: &str) -> f64 {
        let room = measure(facts, Weight::Normal, LABEL_EM) + 24.0;
        let (corner, width) = ((MARGIN, MARGIN / 2.0), WIDTH - 2.0 * MARGIN - room);
        let y = marks::write(scene, self.caption, TITLE_EM, corner, width);
        let at = (WIDTH - MARGIN, MARGIN / 2.0 + 0.95 * TITLE_EM);
        scene.text(plain_text(facts, at, Anchor::End, LABEL_EM).coloured(MUTED));
        y.max(MARGIN / 2.0 + 1.35 * TITLE_EM) + 4.0
    }

    /// A pose, the ground round it, and the path that led to it; the ground below the root is seen
    /// at `corner`.
    fn cell(&self, scene: &mut Scene, frame: usize, scale: f64, corner: Point) {
        let path = path(&self.poses[..=frame]);
        let root = path[frame];
        let seen = see(root);
        let origin = (corner.0 - scale * seen.right, corner.1 + scale * seen.up);
        let view = View { scale, origin };
        let mut ground_line = |line: Segment, colour| {
            scene.line(&line.map(|end| view.point(end)), Stroke::solid(colour, 1.0));
        };
        patch(root, GROUND_RADIUS).into_iter().for_each(|line| ground_line(line, GRID));
        let steps = path.windows(2).map(|step| [step[0], step[1]]);
        let steps = steps.filter_map(|step| within(step, root, GROUND_RADIUS));
        steps.for_each(|step| ground_line(step, MUTED));
        body(scene, &self.poses[frame], &view);
    }
}

/// The figure, the farthest line first.
fn body(scene: &mut Scene, pose: &Pose, view: &View) {
    for stroke in far_to_near(std::slice::from_ref(pose)) {
        let corners = stroke.corners(pose).into_iter().map(|seen| view.place(seen));
        let (corners, width) = (corners.collect::<Vec<Point>>(), stroke.width * view.scale);
        round_line(scene, &corners, WHITE, width + 2.0 * HALO);
        round_line(scene, &corners, stroke.colour, width);
        if stroke.has_head() {
            let (centre, radius) = (view.place(head(pose)), HEAD_RADIUS * view.scale);
            scene.shapes.push(Shape::Disc { centre, radius, colour: INK });
        }
    }
}

/// A line with round ends.
fn round_line(scene: &mut Scene, corners: &[Point], colour: Rgb, width: f64) {
    scene.line(corners, Stroke::solid(colour, width));
    let (radius, ends) = (width / 2.0, [corners[0], corners[corners.len() - 1]]);
    scene.shapes.extend(ends.map(|centre| Shape::Disc { centre, radius, colour }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shown_poses_begin_with_the_first_and_end_with_the_last() {
        assert_eq!(shown(15), [0, 2, 4, 6, 8, 10, 12, 14]);
        assert_eq!(shown(196)[7], 195);
        assert_eq!(shown(3), [0, 1, 2]);
        assert_eq!(shown(1), [0]);
    }
}
