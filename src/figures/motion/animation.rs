//! The animated page: caption, legend, ground, and the body that moves on it by SMIL, which browsers play
//! without a script.

use super::marks::{self, HEAD_RADIUS, REACH, cleaned, facts, far_to_near, head};
use super::room::{Bounds, Seen, Segment, View, below, grid, not_drawn, path, see};
use crate::figures::formats::{self, escaped, unit};
use crate::figures::scene::{Anchor, Point, Scene, Stroke, plain_text};
use crate::figures::style::{GRID, INK, MUTED, Rgb, SHADOW, Weight, measure, wrap};
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
    // For readers of the screen.
    let title = format!("<title>{}</title>\n", escaped(&cleaned(text)));
    let top = marks::write(&mut scene, text, TITLE_EM, (MARGIN, MARGIN), WIDTH - 2.0 * MARGIN);
    if let Some(reason) = not_drawn(poses) {
        let remark = plain_text("", (MARGIN, top + MARGIN), Anchor::Start, REMARK_EM);
        let lines = wrap(&reason, Weight::Normal, REMARK_EM, WIDTH - 2.0 * MARGIN);
        scene.height = (scene.lines(lines, 1.35 * REMARK_EM, &remark) + MARGIN).ceil();
        return formats::svg(&scene, &title, "");
    }
    let path = path(poses);
    let (lines, side) = grid(&path, GROUND_MARGIN);
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
    formats::svg(&scene, &title, &(turn.elements(&view) + &bar))
}

/// Writes the facts and the legend below the caption; returns their lower end.
fn remarks(scene: &mut Scene, top: f64, facts: &str, side: f64) -> f64 {
    let y = top + 1.3 * REMARK_EM;
    let facts = format!("{facts}, squares of {side} m");
    scene.text(plain_text(&facts, (MARGIN, y), Anchor::Start, REMARK_EM).coloured(MUTED));
    let right = MARGIN + measure(&facts, Weight::Normal, REMARK_EM) + MARGIN;
    marks::sides(scene, (right, y), REMARK_EM);
    y
}

/// Everything that is seen of the motion at any time.
fn bounds(poses: &[Pose], lines: &[Segment]) -> Bounds {
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

// The moving parts.

/// More poses than this are thinned; the browser draws straight lines between them.
const MOST_POSES: usize = 240;
/// Pause on the last pose before the motion restarts, seconds.
const PAUSE_S: f64 = 0.5;
/// Half-widths of the shadow below the root, metres.
const SHADOW_RADII: [f64; 2] = [0.2, 0.075];

/// Poses at even times, the last one repeated for the pause.
#[derive(Clone, Debug, PartialEq)]
pub struct Loop {
    poses: Vec<Pose>,
    /// Seconds of the whole, with the pause.
    pub seconds: f64,
    /// The share of the whole that moves.
    pub moving: f64,
}

impl Loop {
    /// The loop of a motion of at least one pose.
    pub fn of(poses: &[Pose], fps: f32) -> Loop {
        let mut thinned = thinned(poses);
        let motion_s = (poses.len() - 1) as f64 / f64::from(fps);
        let steps = thinned.len() - 1;
        let step_s = if steps > 0 { motion_s / steps as f64 } else { PAUSE_S };
        let pause = (PAUSE_S / step_s).round().max(1.0) as usize;
        thinned.extend(vec![thinned[steps]; pause]);
        let seconds = step_s * (steps + pause) as f64;
        Loop { poses: thinned, seconds, moving: motion_s / seconds }
    }

    /// The body and its shadow.
    pub fn elements(&self, view: &View) -> String {
        let [rx, ry] = SHADOW_RADII.map(|radius| unit(radius * view.scale));
        let size = format!("rx=\"{rx}\" ry=\"{ry}\"");
        let mut svg = self.moving_shape("ellipse", &size, SHADOW, |pose| view.point(below(pose)));
        svg.push_str("<g fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n");
        for stroke in far_to_near(&self.poses) {
            let corners = |pose: &Pose| points(stroke.corners(pose), view);
            let (colour, width) = (stroke.colour, unit(stroke.width * view.scale));
            let (first, moving) = (corners(&self.poses[0]), self.animate("points", corners));
            let size = format!("stroke-width=\"{width}\" points=\"{first}\"");
            svg += &format!("<polyline stroke=\"{colour}\" {size}>{moving}</polyline>\n");
            if stroke.has_head() {
                let radius = format!("r=\"{}\"", unit(HEAD_RADIUS * view.scale));
                svg += &self.moving_shape("circle", &radius, INK, |pose| view.place(head(pose)));
            }
        }
        svg.push_str("</g>\n");
        svg
    }

    /// A bar below the motion that fills while it moves.
    pub fn progress(&self, (x, y): Point, width: f64) -> String {
        let [x, y, full] = [x, y, width].map(unit);
        let Self { seconds, moving, .. } = self;
        format!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{full}\" height=\"30\" fill=\"{INK}\">\
             <animate attributeName=\"width\" dur=\"{seconds:.3}s\" repeatCount=\"indefinite\" \
             values=\"0;{full};{full}\" keyTimes=\"0;{moving:.4};1\"/></rect>\n"
        )
    }

    /// A filled shape with a centre.
    fn moving_shape(
        &self,
        element: &str,
        size: &str,
        fill: Rgb,
        centre: impl Fn(&Pose) -> Point,
    ) -> String {
        let xs = self.animate("cx", |pose| unit(centre(pose).0).to_string());
        let ys = self.animate("cy", |pose| unit(centre(pose).1).to_string());
        let (x, y) = centre(&self.poses[0]);
        let (x, y) = (unit(x), unit(y));
        format!(
            "<{element} cx=\"{x}\" cy=\"{y}\" {size} fill=\"{fill}\" stroke=\"none\">{xs}{ys}</{element}>\n"
        )
    }

    fn animate(&self, attribute: &str, value: impl Fn(&Pose) -> String) -> String {
        let values = self.poses.iter().map(value).collect::<Vec<_>>().join(";");
        format!(
            "<animate attributeName=\"{attribute}\" dur=\"{:.3}s\" repeatCount=\"indefinite\" \
             values=\"{values}\"/>",
            self.seconds
        )
    }
}

/// At most [`MOST_POSES`] poses at even times, by linear interpolation.
fn thinned(poses: &[Pose]) -> Vec<Pose> {
    if poses.len() <= MOST_POSES {
        return poses.to_vec();
    }
    let last = poses.len() - 1;
    let step = last as f64 / (MOST_POSES - 1) as f64;
    let at = |i| {
        let time = step * i as f64;
        let before = (time as usize).min(last);
        let (a, b) = (&poses[before], &poses[(before + 1).min(last)]);
        let share = (time - before as f64) as f32;
        let between = |a: f32, b: f32| a + share * (b - a);
        std::array::from_fn(|j| std::array::from_fn(|c| between(a[j][c], b[j][c])))
    };
    (0..MOST_POSES).map(at).collect()
}

fn points(corners: Vec<Seen>, view: &View) -> String {
    let places = corners.into_iter().map(|seen| view.place(seen));
    let pairs = places.map(|(x, y)| format!("{},{}", unit(x), unit(y)));
    pairs.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_JOINTS;

    fn rising(n: usize) -> Vec<Pose> {
        (0..n).map(|t| [[0.0, t as f32, 0.0]; N_JOINTS]).collect()
    }

    #[test]
    fn a_loop_lasts_as_long_as_the_motion_and_the_pause() {
        for n in [2, 41, 240, 1001] {
            let turn = Loop::of(&rising(n), 20.0);
            let motion_s = (n - 1) as f64 / 20.0;
            assert!((turn.seconds * turn.moving - motion_s).abs() < 1e-9);
            // The pause is a whole number of steps.
            let step_s = motion_s / (n.min(MOST_POSES) - 1) as f64;
            assert!((turn.seconds - motion_s - 0.5).abs() <= 0.5 * step_s + 1e-9, "{n}");
            assert!(turn.poses.len() <= MOST_POSES + 20);
            assert_eq!(turn.poses[0], rising(1)[0]);
            assert_eq!(turn.poses.last(), rising(n).last());
        }
    }

    #[test]
    fn thinned_poses_lie_at_even_times() {
        let thinned = thinned(&rising(1000));
        assert_eq!(thinned.len(), MOST_POSES);
        let heights: Vec<f32> = thinned.iter().map(|pose| pose[0][1]).collect();
        let step = 999.0 / 239.0;
        assert!(heights.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() < 1e-3));
    }

    #[test]
    fn a_single_pose_stands_still() {
        let turn = Loop::of(&rising(1), 20.0);
        assert_eq!((turn.seconds, turn.moving, turn.poses.len()), (0.5, 0.0, 2));
    }
}
