//! Logits, loss and gradients of the scale-by-scale and the masked transformer, and the codes that
//! rounds of unmasking leave, against implementations in JAX and float64.
//!
//! `fixtures/generators/make.py` writes the numbers. It takes one clip at a time and masks densely where
//! the library packs clips and works by blocks. Parameters are exact in `f32`; what is left is the
//! library's rounding.

#[path = "../support/corpus.rs"]
#[expect(dead_code, reason = "its small run alone is wanted")]
mod corpus;
mod masked;
#[path = "../support/no_scales.rs"]
mod no_scales;
#[path = "../support/reference.rs"]
mod reference;
mod scalewise;

use burn::tensor::Tensor;
use serde::de::DeserializeOwned;

use isoflop::learn::weights::{HostTensor, Source};
use reference::{Reference, TOLERANCE};

fn read<N: DeserializeOwned>(name: &str) -> Reference<N> {
    Reference::read("generators", name)
}

fn close(found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < TOLERANCE, "{found} against {expected}");
}

/// The values of matrices after one another.
fn concat(rows: impl IntoIterator<Item = Tensor<2>>) -> HostTensor {
    let values: Vec<f32> = rows.into_iter().flat_map(|x| Source::of(x).on_host().values).collect();
    HostTensor { shape: vec![values.len()], values }
}
