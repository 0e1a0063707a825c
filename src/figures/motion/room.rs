//! The room: an orthographic camera above and beside the body, and the ground at y = 0 with a fixed grid and the
//! root's path.

use crate::figures::axis::span;
use crate::figures::scene::Point;
use crate::motion::Pose;

/// Angle of the camera about the vertical from +z towards +x, degrees: a body that faces +z walks to the right and a
/// little towards the viewer, its right side nearer.
const AZIMUTH: f64 = -55.0;
/// Downward angle of the camera, degrees.
const ELEVATION: f64 = 20.0;

/// A point as the camera sees it, metres: to the right, upwards, and towards the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    pub right: f64,
    pub up: f64,
    pub near: f64,
}

/// A point of the room (metres, y up) as the camera sees it.
///
/// The three directions are at right angles and right-handed, so nothing is mirrored.
pub fn see([x, y, z]: [f64; 3]) -> Seen {
    let ((sin_a, cos_a), (sin_e, cos_e)) =
        (AZIMUTH.to_radians().sin_cos(), ELEVATION.to_radians().sin_cos());
    let (right, front) = (x * cos_a - z * sin_a, x * sin_a + z * cos_a);
    Seen { right, up: y * cos_e - front * sin_e, near: y * sin_e + front * cos_e }
}

/// The bounding rectangle of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub left: f64,
    pub right: f64,
    pub bottom: f64,
    pub top: f64,
}

impl Bounds {
    /// The rectangle round `points`; of no points, an empty one.
    pub fn of(points: impl Iterator<Item = Seen>) -> Bounds {
        let (low, high) = (f64::INFINITY, f64::NEG_INFINITY);
        let none = Bounds { left: low, right: high, bottom: low, top: high };
        let at = |Seen { right: x, up: y, .. }| Bounds { left: x, right: x, bottom: y, top: y };
        points.map(at).fold(none, Bounds::with)
    }

    /// The same with `margin` metres more on each side.
    pub fn wider(self, margin: f64) -> Bounds {
        Bounds {
            left: self.left - margin,
            right: self.right + margin,
            bottom: self.bottom - margin,
            top: self.top + margin,
        }
    }

    /// The rectangle round two.
    pub fn with(self, other: Bounds) -> Bounds {
        Bounds {
            left: self.left.min(other.left),
            right: self.right.max(other.right),
            bottom: self.bottom.min(other.bottom),
            top: self.top.max(other.top),
        }
    }

    pub fn width(&self) -> f64 {
        self.right - self.left
    }

    pub fn height(&self) -> f64 {
        self.top - self.bottom
    }
}

/// The placement of the scene on a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Page pixels a metre.
    pub scale: f64,
    /// The page position of the scene's origin.
    pub origin: Point,
}

impl View {
    pub fn place(&self, seen: Seen) -> Point {
        (self.origin.0 + self.scale * seen.right, self.origin.1 - self.scale * seen.up)
    }

    /// [`see`], then [`View::place`].
    pub fn point(&self, point: [f64; 3]) -> Point {
        self.place(see(point))
    }
}

/// Nobody gets farther in a motion that is drawn, metres: a model that made such a place has diverged.
const FARTHEST_M: f32 = 1000.0;

/// Why a motion is not drawn, as a clause; `None` if it can be.
pub fn not_drawn(poses: &[Pose]) -> Option<String> {
    let is_beyond = |place: &&f32| place.is_nan() || place.abs() > FARTHEST_M;
    let beyond = |pose: &Pose| pose.as_flattened().iter().find(is_beyond).copied();
    let mut places = poses.iter().enumerate();
    let (frame, place) = places.find_map(|(frame, pose)| Some((frame, beyond(pose)?)))?;
    Some(match place.is_finite() {
        true => format!(
            "in frame {frame} a joint is {:.0e} m off the origin, beyond the {FARTHEST_M} m that are drawn",
            place.abs()
        ),
        false => format!("in frame {frame} a joint is at no finite place"),
    })
}

// The ground.

/// Metres from line to line.
const SPACING: f64 = 0.5;
/// More lines than this on a side would be a grey area.
const MOST_LINES: f64 = 40.0;

/// A segment on the ground.
pub type Segment = [[f64; 3]; 2];

/// The root of each pose, on the ground.
pub fn path(poses: &[Pose]) -> Vec<[f64; 3]> {
    poses.iter().map(below).collect()
}

/// The root of a pose, on the ground.
pub fn below(pose: &Pose) -> [f64; 3] {
    [f64::from(pose[0][0]), 0.0, f64::from(pose[0][2])]
}

/// Length of a path, metres.
pub fn length(path: &[[f64; 3]]) -> f64 {
    path.windows(2).map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][2] - pair[0][2])).sum()
}

/// Squares that cover the area within `margin` metres of a path along x and z, and their side in metres: [`SPACING`],
/// or twice, four times … as much for long paths.
pub fn grid(path: &[[f64; 3]], margin: f64) -> (Vec<Segment>, f64) {
    let range = |c: usize| {
        let [low, high] = span(path.iter().map(|point| point[c]));
        (low - margin, high + margin)
    };
    let (x, z) = (range(0), range(2));
    let longest = (x.1 - x.0).max(z.1 - z.0);
    let doublings = (longest / (SPACING * MOST_LINES)).log2().ceil().max(0.0);
    let side = SPACING * doublings.exp2();
    let snap = |(low, high): (f64, f64)| ((low / side).floor() * side, (high / side).ceil() * side);
    let (x, z) = (snap(x), snap(z));
    let along_z = steps(x, side).map(|x| [[x, 0.0, z.0], [x, 0.0, z.1]]);
    let along_x = steps(z, side).map(|z| [[x.0, 0.0, z], [x.1, 0.0, z]]);
    (along_z.chain(along_x).collect(), side)
}

fn steps((low, high): (f64, f64), side: f64) -> impl Iterator<Item = f64> {
    let n = ((high - low) / side).round() as usize;
    (0..=n).map(move |i| low + side * i as f64)
}

/// The pieces of the room's grid within `radius` metres of a point of the ground.
pub fn patch(centre: [f64; 3], radius: f64) -> Vec<Segment> {
    let lines = grid(&[centre], radius).0;
    lines.iter().filter_map(|&line| within(line, centre, radius)).collect()
}

/// The part of a segment within `radius` of `centre`, both on the ground.
pub fn within([a, b]: Segment, centre: [f64; 3], radius: f64) -> Option<Segment> {
    let (dx, dz) = (b[0] - a[0], b[2] - a[2]);
    let (fx, fz) = (a[0] - centre[0], a[2] - centre[2]);
    let (p, q, r) = (dx * dx + dz * dz, fx * dx + fz * dz, fx * fx + fz * fz - radius * radius);
    let root = (q * q - p * r).sqrt();
    // NaN if the line misses the circle or the segment has no length.
    if !(root / p).is_finite() {
        return None;
    }
    let (from, to) = (((-q - root) / p).max(0.0), ((-q + root) / p).min(1.0));
    let at = |share: f64| [a[0] + share * dx, 0.0, a[2] + share * dz];
    (from < to).then(|| [at(from), at(to)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_mirrors_nothing_and_keeps_up() {
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(see);
        let volume = x.right * (y.up * z.near - y.near * z.up)
            - x.up * (y.right * z.near - y.near * z.right)
            + x.near * (y.right * z.up - y.up * z.right);
        assert!((volume - 1.0).abs() < 1e-12, "{volume}");
        assert!(y.right == 0.0 && y.up > 0.9);
        // Walking along +z goes right and nearer; the body's left is the far side.
        assert!(z.right > 0.5 && z.near > 0.3 && x.near < -0.5);
    }

    #[test]
    fn bounds_hold_every_point() {
        let seen = |right, up| Seen { right, up, near: 0.0 };
        let bounds = Bounds::of([seen(1.0, 2.0), seen(-3.0, 0.5)].into_iter());
        assert_eq!(bounds, Bounds { left: -3.0, right: 1.0, bottom: 0.5, top: 2.0 });
        assert_eq!(bounds.wider(0.5).with(bounds), bounds.wider(0.5));
    }

    #[test]
    fn the_grid_stands_still_in_the_room_and_covers_the_path() {
        let (lines, side) = grid(&[[0.2, 0.0, 0.1], [0.2, 0.0, 1.7]], 0.4);
        assert_eq!(side, 0.5);
        // x from -0.5 to 1, z from -0.5 to 2.5.
        assert_eq!(lines.len(), 4 + 7);
        assert!(lines.iter().flatten().all(|p| (p[0] / side).fract() == 0.0));
        assert!(lines.contains(&[[1.0, 0.0, -0.5], [1.0, 0.0, 2.5]]));
    }

    #[test]
    fn a_long_path_has_larger_squares() {
        let (lines, side) = grid(&[[0.0; 3], [1e6, 0.0, 0.0]], 0.5);
        assert!(side > 1000.0 && lines.len() < 50, "{side} {}", lines.len());
    }

    #[test]
    fn a_segment_is_cut_at_the_circle() {
        let line = [[-2.0, 0.0, 0.6], [2.0, 0.0, 0.6]];
        let [a, b] = within(line, [0.0; 3], 1.0).unwrap();
        assert!((a[0] + 0.8).abs() < 1e-12 && (b[0] - 0.8).abs() < 1e-12);
        assert_eq!(within(line, [0.0, 0.0, 2.0], 1.0), None);
        assert_eq!(within([[0.0; 3]; 2], [0.0; 3], 1.0), None);
    }
}
