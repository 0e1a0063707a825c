//! The little mathematics of the generator: draws, curves, numbers that blend, vectors and rotations, and the
//! floor with its left and right.

use std::f32::consts::TAU;

use rand_chacha::rand_core::Rng;

use crate::motion::geometry::{dot, scale};

/// Frames per second of every clip.
pub const FPS: f32 = 20.0;

// Draws.

/// Draws from simple distributions, for every generator of random words.
pub trait Draw: Rng {
    /// Uniform in `[0, 1)`, 24 bits.
    fn unit(&mut self) -> f32 {
        (self.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in `[low, high)`.
    fn uniform(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform with mean 0 and deviation 1.
    fn white(&mut self) -> f32 {
        (self.unit() - 0.5) * 3.464_101_6
    }

    /// Normal by Box and Muller, cut at 2.5 deviations: no body is ten deviations from the mean.
    fn around(&mut self, mean: f32, deviation: f32) -> f32 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        let angle = TAU * self.unit();
        mean + deviation * (radius * angle.cos()).clamp(-2.5, 2.5)
    }

    /// True with the given probability.
    fn chance(&mut self, probability: f32) -> bool {
        self.unit() < probability
    }

    /// Uniform over `low..=high`.
    fn int(&mut self, low: u32, high: u32) -> u32 {
        let n = u64::from(high - low) + 1;
        low + ((u64::from(self.next_u32()) * n) >> 32) as u32
    }

    /// One of `items`, each as likely.
    fn one_of<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.int(0, items.len() as u32 - 1) as usize]
    }

    /// One of a table of items, each as likely as its weight is of their sum.
    fn weighted<T: Copy>(&mut self, table: &[(T, f32)]) -> T {
        let mut left = self.unit() * table.iter().map(|(_, weight)| weight).sum::<f32>();
        for &(item, weight) in table {
            left -= weight;
            if left < 0.0 {
                return item;
            }
        }
        table[table.len() - 1].0
    }
}

impl<R: Rng + ?Sized> Draw for R {}

// Structs of numbers that blend, and the curves that they blend along.

/// Several numbers with element-wise operations.
pub trait Blend: Sized {
    /// Fills the numbers in their order.
    fn from_fn(value: impl FnMut() -> f32) -> Self;

    /// Combines two values number by number.
    fn zip(self, other: Self, combine: impl Fn(f32, f32) -> f32) -> Self;

    /// `self` at weight 0, `other` at weight 1.
    fn mix(self, other: Self, weight: f32) -> Self {
        self.zip(other, |a, b| a + (b - a) * weight)
    }
}

/// Declares a struct of `f32` fields that blend.
macro_rules! blendable {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$field_meta:meta])* $field:ident,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct $name { $($(#[$field_meta])* pub $field: f32,)* }

        impl $crate::motion::synth::maths::Blend for $name {
            fn from_fn(mut value: impl FnMut() -> f32) -> Self {
                Self { $($field: value(),)* }
            }

            fn zip(self, other: Self, combine: impl Fn(f32, f32) -> f32) -> Self {
                Self { $($field: combine(self.$field, other.$field),)* }
            }
        }
    };
}

/// 0 before 0, 1 after 1, and `3u² - 2u³` between.
pub fn smooth(u: f32) -> f32 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// Rises from 0 to 1 over `ramp` after 0 and falls back to 0 over `ramp` before `end`.
pub fn plateau(t: f32, end: f32, ramp: f32) -> f32 {
    smooth(t / ramp) * smooth((end - t) / ramp)
}

/// The parabola that is 0 at 0 and at 1 and 1 half-way, and 0 outside.
pub fn arch(u: f32) -> f32 {
    (4.0 * u * (1.0 - u)).max(0.0)
}

// Left and right, and the floor.

/// A side of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Left,
    Right,
}

impl Side {
    /// Both sides, at their own indices.
    pub const BOTH: [Side; 2] = [Side::Left, Side::Right];

    /// The x axis points to the left: +1 for the left side, -1 for the right.
    pub fn sign(self) -> f32 {
        [1.0, -1.0][self.index()]
    }

    /// 0 for the left side, 1 for the right.
    pub fn index(self) -> usize {
        self as usize
    }

    /// The opposite side.
    pub fn other(self) -> Self {
        Side::BOTH[1 - self.index()]
    }

    /// The word in a caption.
    pub fn word(self) -> &'static str {
        ["left", "right"][self.index()]
    }
}

blendable! {
    /// A point of the floor and a direction: `yaw` turns +z towards +x.
    pub struct FloorPose {
        x,
        z,
        yaw,
    }
}

impl FloorPose {
    /// The place `left` and `forward` of this one, facing the same way.
    pub fn offset(self, left: f32, forward: f32) -> Self {
        let (s, c) = self.yaw.sin_cos();
        Self { x: self.x + c * left + s * forward, z: self.z - s * left + c * forward, ..self }
    }

    /// Offset of this point to the left and ahead of `root`: the inverse of [`FloorPose::offset`].
    pub fn seen_from(self, root: Self) -> (f32, f32) {
        let (s, c) = root.yaw.sin_cos();
        let (dx, dz) = (self.x - root.x, self.z - root.z);
        (c * dx - s * dz, s * dx + c * dz)
    }

    /// The same point, facing `angle` further to the left.
    pub fn turned(self, angle: f32) -> Self {
        Self { yaw: self.yaw + angle, ..self }
    }
}

blendable! {
    /// Velocity in the body's frame, per second.
    pub struct Drive {
        left,
        forward,
        /// Radians to the left.
        yaw,
    }
}

// Vectors and rotation matrices.

/// A vector or a point.
pub type V3 = [f32; 3];

/// Euclidean length.
pub fn norm(a: V3) -> f32 {
    dot(a, a).sqrt()
}

/// `a` with length 1.
pub fn unit(a: V3) -> V3 {
    scale(a, 1.0 / norm(a))
}

/// A rotation, by rows.
#[derive(Clone, Copy, Debug)]
pub struct Rotation([V3; 3]);

impl Rotation {
    /// About x; positive tips up towards +z, a bend forward.
    pub fn x(angle: f32) -> Self {
        let (s, c) = angle.sin_cos();
        Self([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    }

    /// About y; positive turns +z towards +x, a turn to the left.
    pub fn y(angle: f32) -> Self {
        let (s, c) = angle.sin_cos();
        Self([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    }

    /// About z; positive tips up towards -x, a lean to the right.
    pub fn z(angle: f32) -> Self {
        let (s, c) = angle.sin_cos();
        Self([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    }

    /// About z, then about x, then about y.
    pub fn yxz(y: f32, x: f32, z: f32) -> Self {
        Self::y(y).after(Self::x(x)).after(Self::z(z))
    }

    /// First `other`, then `self`.
    pub fn after(self, other: Self) -> Self {
        let (a, b) = (self.0, other.0);
        Self(a.map(|row| {
            let column = |j: usize| row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j];
            [column(0), column(1), column(2)]
        }))
    }

    /// The rotated vector.
    pub fn of(self, v: V3) -> V3 {
        self.0.map(|row| dot(row, v))
    }
}
