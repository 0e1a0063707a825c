//! [`Motion`]: what `motions.json` says of a motion.

use isoflop::scores::Physics;
use serde::Serialize;

/// An element of `motions.json`.
#[derive(Serialize)]
pub struct Motion {
    pub caption: String,
    pub seed: u64,
    /// Frames.
    pub length: usize,
    /// Frames a second.
    pub fps: f64,
    pub seconds: f64,
    /// Scale after scale.
    pub codes: Vec<u32>,
    /// Whether the model ended the motion, or had a length to meet.
    pub ended: bool,
    /// How far the rigid body of the BVH is from the joints, at most and on the mean.
    pub bvh_largest_mm: f64,
    pub bvh_mean_mm: f64,
    /// What can be seen of it without an evaluator; `None` below four frames.
    pub physics: Option<Physics>,
    pub run: String,
}
