//! [`TestNoise`]: what moves all losses together from one test split to another.

use serde::{Deserialize, Serialize};

use super::random::Normals;

/// Keeps the streams of other test splits apart from those of replicates.
const STREAMS: u64 = 1 << 41;

/// By how much losses differ between test splits like the one that runs were measured on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TestNoise {
    /// Standard deviation of what moves all losses together, in nats.
    pub sd: f64,
    /// Parts of the test split that have no recording in common.
    pub blocks: usize,
}

impl TestNoise {
    /// Losses on this test split as ones on others.
    pub(crate) fn moved(&self, losses: &[f64]) -> Vec<f64> {
        let moved = |(i, loss): (usize, &f64)| {
            let mut normals = Normals::of_stream(STREAMS, i as u64);
            loss + self.sd * student(self.blocks - 1, &mut normals) * normals.next()
        };
        losses.iter().enumerate().map(moved).collect()
    }
}

/// The factor by which a deviation of so many degrees of freedom may be too small.
pub(super) fn student(dof: usize, normals: &mut Normals) -> f64 {
    (dof as f64 / normals.chi_square(dof)).sqrt()
}
