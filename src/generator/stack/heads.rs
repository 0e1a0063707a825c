//! The losses of codes that have a head for each of their scales or layers.
//!
//! Shapes: n rows of the batch, d width.

use std::sync::Arc;

use burn::tensor::Tensor;

use super::layers::EPSILON;
use crate::ops::{HeadWeights, Kernels};

/// Supervised codes of one scale or layer.
#[derive(Clone, Debug, Default)]
pub struct Supervised {
    /// Rows that predict them.
    pub rows: Arc<[u32]>,
    /// What they should predict, below the codebook's V.
    pub codes: Arc<[u32]>,
}

impl From<(Vec<u32>, Vec<u32>)> for Supervised {
    fn from((rows, codes): (Vec<u32>, Vec<u32>)) -> Self {
        Self { rows: rows.into(), codes: codes.into() }
    }
}

/// Supervised codes in all.
pub fn n_supervised(targets: &[Supervised]) -> usize {
    targets.iter().map(|own| own.codes.len()).sum()
}

/// Mean cross-entropy over all supervised codes, in nats, `[1]`, of what the blocks made of all rows,
/// `[n, d]`; each of the targets has its own head.
pub fn heads_loss(
    kernels: Kernels,
    x_nd: &Tensor<2>,
    targets: &[Supervised],
    head: impl Fn(usize) -> HeadWeights,
) -> Tensor<1> {
    let n = n_supervised(targets) as f64;
    let some = targets.iter().enumerate().filter(|(_, own)| !own.rows.is_empty());
    let losses = some.map(|(index, own)| {
        let x_sd = kernels.select_rows(x_nd.clone(), &own.rows);
        let mean = kernels.head_loss(x_sd, head(index), &own.codes, EPSILON);
        mean * (own.codes.len() as f64 / n)
    });
    losses.reduce(|sum, loss| sum + loss).expect("a batch supervises something")
}

/// −ln p of each supervised code, in nats, by the targets, as [`heads_loss`] has them.
pub fn heads_nll(
    kernels: Kernels,
    x_nd: &Tensor<2>,
    targets: &[Supervised],
    head: impl Fn(usize) -> HeadWeights,
) -> Vec<Vec<f64>> {
    let nll = targets.iter().enumerate().map(|(index, own)| {
        if own.rows.is_empty() {
            return Vec::new();
        }
        let x_sd = kernels.select_rows(x_nd.clone(), &own.rows);
        kernels.head_nll(x_sd, head(index), &own.codes, EPSILON)
    });
    nll.collect()
}
