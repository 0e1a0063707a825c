//! The ground at y = 0: a grid that stands still in the room, and the root's path on it.

use crate::motion::Pose;

/// Metres from line to line.
pub const SPACING: f64 = 0.5;
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

/// Squares that cover what lies within `margin` metres of a path along x and z, and their side in
/// metres: [`SPACING`], or twice, four times … as much where the path is long.
pub fn grid(path: &[[f64; 3]], margin: f64) -> (Vec<Segment>, f64) {
    let range = |c: usize| {
        let (low, high) = extent(path, c);
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

fn extent(path: &[[f64; 3]], c: usize) -> (f64, f64) {
    path.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| {
        (low.min(point[c]), high.max(point[c]))
    })
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
    // No number where the line misses the circle or the segment has no length.
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
