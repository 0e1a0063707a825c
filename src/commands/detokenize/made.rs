//! [`Made`]: what is said of a motion that was made of codes.

use serde::Serialize;

/// A motion that was made.
#[derive(Serialize)]
pub struct Made {
    /// Its name: that of its files.
    pub motion: String,
    pub frames: usize,
    /// From the original, where that was found.
    pub mpjpe_mm: Option<f64>,
    /// How far the rigid body of the BVH is from the joints, at most and on the mean.
    pub bvh_largest_mm: f64,
    pub bvh_mean_mm: f64,
}
