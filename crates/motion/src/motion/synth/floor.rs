//! Left and right, and where something stands on the floor.

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

/// A point of the floor and a direction: `yaw` turns +z towards +x.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FloorPose {
    pub x: f32,
    pub z: f32,
    pub yaw: f32,
}

impl FloorPose {
    /// The place `left` and `forward` of this one, facing the same way.
    pub fn offset(self, left: f32, forward: f32) -> Self {
        let (s, c) = self.yaw.sin_cos();
        Self { x: self.x + c * left + s * forward, z: self.z - s * left + c * forward, ..self }
    }

    /// How far to the left and ahead of `root` this point is: [`FloorPose::offset`] undone.
    pub fn seen_from(self, root: Self) -> (f32, f32) {
        let (s, c) = root.yaw.sin_cos();
        let (dx, dz) = (self.x - root.x, self.z - root.z);
        (c * dx - s * dz, s * dx + c * dz)
    }

    /// The same point, facing `angle` further to the left.
    pub fn turned(self, angle: f32) -> Self {
        Self { yaw: self.yaw + angle, ..self }
    }

    /// `self` at weight 0, `other` at weight 1.
    pub fn mix(self, other: Self, weight: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * weight;
        Self { x: mix(self.x, other.x), z: mix(self.z, other.z), yaw: mix(self.yaw, other.yaw) }
    }
}
