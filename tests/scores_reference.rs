//! Scores against NumPy and SciPy on drawn embeddings; `fixtures/scores/make.py` writes the numbers.

#[path = "support/reference.rs"]
#[expect(dead_code, reason = "its file alone is wanted")]
mod reference;

use isoflop::scores::{Embeddings, POOL, cosine_score, frechet_distance, retrieval};
use reference::Reference;
use serde::Deserialize;

/// Largest difference, as a share of the reference.
const TOLERANCE: f64 = 1e-6;

#[derive(Deserialize)]
struct Notes {
    fid: f64,
    precision: [f64; 3],
    matching_distance: f64,
    cosine: f64,
    n_texts: usize,
}

fn embeddings(drawn: &Reference<Notes>, name: &str) -> Embeddings {
    let tensor = &drawn.tensors[name];
    let values = tensor.values.iter().map(|value| f64::from(*value)).collect();
    Embeddings::new(values, tensor.shape[1]).expect("rows of finite numbers")
}

fn close(name: &str, found: f64, expected: f64) {
    assert!((found - expected).abs() <= TOLERANCE * expected.abs(), "{name}: {found} {expected}");
}

#[test]
fn scores_are_those_of_the_reference() {
    let drawn: Reference<Notes> = Reference::read("scores", "drawn");
    let [truth, made, texts] = ["truth", "made", "texts"].map(|name| embeddings(&drawn, name));
    let Notes { fid, precision, matching_distance, cosine, n_texts } = drawn.notes;
    close("FID", frechet_distance(&truth, &made).expect("two sets"), fid);
    let found = retrieval(&texts, &truth, POOL).expect("pairs");
    assert_eq!((found.precision, found.n_texts), (precision, n_texts));
    assert!(precision[0] > 0.1 && precision[0] < precision[2], "{precision:?}");
    close("MM-Dist", found.matching_distance, matching_distance);
    close("cosine", cosine_score(&texts, &truth).expect("pairs"), cosine);
}
