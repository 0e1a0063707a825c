//! The animated page: caption, legend, ground, and the body that moves on it.

use super::animation::Loop;
use super::body::REACH;
use super::camera::{Bounds, View, see};
use super::caption;
use super::ground;
use super::legend;
use crate::figures::colour::{GRID, MUTED};
use crate::figures::font::{Weight, measure};
use crate::figures::scene::plain_text;
use crate::figures::scene::{Anchor, Scene, Stroke, Text};
use crate::figures::svg::{self, escaped};
use crate::motion::Pose;

const WIDTH: f64 = 640.0;
const MARGIN: f64 = 18.0;
const TITLE_EM: f64 = 15.0;
const REMARK_EM: f64 = 12.0;
/// The tallest and the lowest picture, page pixels.
const PICTURE_HEIGHT: (f64, f64) = (220.0, 420.0);
/// The ground reaches this far beyond the root's path, metres.
const GROUND_MARGIN: f64 = 0.6;
/// Below the picture: the bar of progress.
const FOOTER: f64 = 14.0;

/// The SVG of a motion of at least one pose, which plays in a loop at `fps` poses a second.
pub fn svg(poses: &[Pose], fps: f32, text: &str) -> String {
    let mut scene = Scene::new(WIDTH, 0.0);
    let path = ground::path(poses);
    let (lines, side) = ground::grid(&path, GROUND_MARGIN);
    let top = caption::write(&mut scene, text, TITLE_EM, (MARGIN, MARGIN), WIDTH - 2.0 * MARGIN);
    let top = remarks(&mut scene, top, &facts(poses, fps), side) + MARGIN;
    let bounds = bounds(poses, &lines);
    let (view, height) = view(bounds, top);
    for line in lines {
        scene.line(&line.map(|end| view.point(end)), Stroke::solid(GRID, 1.0));
    }
    let path: Vec<_> = path.into_iter().map(|point| view.point(point)).collect();
    scene.line(&path, Stroke::solid(MUTED, 1.0));
    scene.height = (top + height + FOOTER + MARGIN).ceil();
    let turn = Loop::of(poses, fps);
    let bar = turn.progress((MARGIN, scene.height - MARGIN), WIDTH - 2.0 * MARGIN);
    // For readers of the screen.
    let title = format!("<title>{}</title>\n", escaped(&caption::cleaned(text)));
    svg::svg(&scene, &title, &(turn.elements(&view) + &bar))
}

/// What one reads of a motion: "6.4 s, 20 frames a second, path 4.2 m".
pub fn facts(poses: &[Pose], fps: f32) -> String {
    let seconds = poses.len() as f64 / f64::from(fps);
    let metres = ground::length(&ground::path(poses));
    format!("{seconds:.1} s, {fps} frames a second, path {metres:.1} m")
}

/// Writes the facts and the legend below the caption; returns where they end.
fn remarks(scene: &mut Scene, top: f64, facts: &str, side: f64) -> f64 {
    let y = top + 1.3 * REMARK_EM;
    let facts = format!("{facts}, squares of {side} m");
    let text = plain_text(&facts, (MARGIN, y), Anchor::Start, REMARK_EM);
    scene.text(Text { colour: MUTED, ..text });
    let right = MARGIN + measure(&facts, Weight::Normal, REMARK_EM) + MARGIN;
    legend::sides(scene, (right, y), REMARK_EM);
    y
}

/// Everything that is seen of the motion at any time.
fn bounds(poses: &[Pose], lines: &[ground::Segment]) -> Bounds {
    let joints = poses.as_flattened().iter().map(|joint| see(joint.map(f64::from)));
    let ground = Bounds::of(lines.iter().flatten().map(|&end| see(end)));
    Bounds::of(joints).wider(REACH).with(ground)
}

/// A view that holds `bounds` in the middle of the page below `top`, and its height.
fn view(bounds: Bounds, top: f64) -> (View, f64) {
    let (low, high) = PICTURE_HEIGHT;
    let width = WIDTH - 2.0 * MARGIN;
    let scale = (width / bounds.width()).min(high / bounds.height());
    let height = (scale * bounds.height()).max(low);
    let middle = [bounds.left + bounds.right, bounds.bottom + bounds.top].map(|sum| sum / 2.0);
    let origin = (WIDTH / 2.0 - scale * middle[0], top + height / 2.0 + scale * middle[1]);
    (View { scale, origin }, height)
}
