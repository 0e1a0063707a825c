//! `--clean-feet`: pins feet that slide, and says what was moved.

use super::prelude::*;
use isoflop::motion::{clean_feet, recover_joints};
use isoflop::scores::physics;

/// What was moved in a motion, and its body before and after.
#[derive(Clone, Copy, Serialize)]
pub struct CleanedFeet {
    /// Contacts of a foot with the floor that were pinned.
    pub contacts: usize,
    /// Contacts that were left: the foot travels too far for a place.
    pub left: usize,
    /// Mean displacement of a foot over the frames in which it moved.
    pub mean_mm: f64,
    pub largest_mm: f64,
    /// Skating ratio, and jerk in m/s³; `None` below four frames.
    pub foot_skate_before: Option<f64>,
    pub foot_skate_after: Option<f64>,
    pub jerk_before: Option<f64>,
    pub jerk_after: Option<f64>,
}

impl CleanedFeet {
    /// Cleans the feet of features, `[T, 263]` row-major, not normalised, of `fps` frames a second.
    pub fn clean(features: &mut Vec<f32>, fps: f64) -> Self {
        let (cleaned, moved) = clean_feet(features, fps);
        let of = |features: &[f32]| physics(&recover_joints(features), fps).ok();
        let [before, after] = [of(features), of(&cleaned)];
        *features = cleaned;
        Self {
            contacts: moved.contacts,
            left: moved.left,
            mean_mm: moved.mean_mm,
            largest_mm: moved.largest_mm,
            foot_skate_before: before.map(|own| own.foot_skate),
            foot_skate_after: after.map(|own| own.foot_skate),
            jerk_before: before.map(|own| own.jerk),
            jerk_after: after.map(|own| own.jerk),
        }
    }
}

/// A line on all motions that were cleaned; empty without one.
pub fn feet_line(feet: &[CleanedFeet]) -> String {
    if feet.is_empty() {
        return String::new();
    }
    let mean = |of: fn(&CleanedFeet) -> Option<f64>| {
        let values: Vec<f64> = feet.iter().filter_map(of).collect();
        values.iter().sum::<f64>() / values.len().max(1) as f64
    };
    let contacts: usize = feet.iter().map(|own| own.contacts).sum();
    let left: usize = feet.iter().map(|own| own.left).sum();
    let left = if left > 0 { format!(" ({left} left)") } else { String::new() };
    let largest = feet.iter().map(|own| own.largest_mm).fold(0.0, f64::max);
    format!(
        "feet      {} pinned{left}, moved by {:.0} mm, at most {largest:.0}\n          \
             sliding {:.0} % before and {:.0} % after, jerk {:.0} and {:.0} m/s³\n",
        many(contacts, "contact"),
        mean(|own| (own.contacts > 0).then_some(own.mean_mm)),
        100.0 * mean(|own| own.foot_skate_before),
        100.0 * mean(|own| own.foot_skate_after),
        mean(|own| own.jerk_before),
        mean(|own| own.jerk_after),
    )
}
