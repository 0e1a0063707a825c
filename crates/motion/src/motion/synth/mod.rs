//! A seeded generator of human motion: the built-in data set.
//!
//! Data flows one way: [`Script`] (who, in what manner, which actions, when) → root path and
//! footsteps → posture of each frame → joints. The skeleton is the 22-joint one of HumanML3D with
//! its bone lengths, so bones keep their lengths exactly; feet are planted and legs reach them by
//! two-bone inverse kinematics; arms and trunk are angles, so nothing can stretch.
//!
//! A clip holds structure at many scales, for models of many sizes to find: noise and breathing
//! within a frame, gait cycles, a step count and a turn angle, repeated actions that repeat their
//! own numbers, and a manner that lasts for the whole clip and is named in its captions.
//!
//! Frames: right-handed, y up, the body faces +z and its left is +x. Metres, seconds, radians.

#[macro_use]
mod blend;

mod act;
mod action;
mod body;
mod caption;
mod drive;
mod feet;
mod floor;
mod geometry;
mod hands;
mod jump;
mod kick;
mod manner;
mod path;
mod perform;
mod phrase;
mod plan;
mod posture;
mod random;
mod script;
mod style;
mod travel;
mod verbs;
mod wander;

pub use script::Script;

#[cfg(test)]
mod tests;

/// Frames per second of every clip.
pub const FPS: f32 = 20.0;

/// Raised whenever the same seed no longer gives the same clips; part of a data set's digest.
pub const REVISION: u32 = 1;
