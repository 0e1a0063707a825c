//! [`Drive`]: how an action drives the root.

/// Velocity in the body's frame, per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drive {
    pub left: f32,
    pub forward: f32,
    /// Radians to the left.
    pub yaw: f32,
}
