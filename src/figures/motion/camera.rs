//! An orthographic camera, above and beside the body, and the picture that it fills.

use crate::figures::scene::Point;

/// Where the camera stands, as an angle about the vertical from +z towards +x, degrees: a body that
/// faces +z walks to the right and a little towards the viewer, its right side nearer.
const AZIMUTH: f64 = -55.0;
/// How far the camera looks down, degrees.
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

/// The smallest upright rectangle round what is seen.
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
        points.fold(none, |bounds, seen| Bounds {
            left: bounds.left.min(seen.right),
            right: bounds.right.max(seen.right),
            bottom: bounds.bottom.min(seen.up),
            top: bounds.top.max(seen.up),
        })
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

/// Where on a page what is seen is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Page pixels a metre.
    pub scale: f64,
    /// Where on the page the point is that is seen at 0, 0.
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
}
