//! [`measurable`]: a generator that a probe can build.

use super::kind::MOST_PROBED_PARAMS;
use crate::plan::RunSpec;
use crate::spec::{GeneratorSpec, Grid, ModelShape};

/// A run's generator for such codes, or one of its kind with fewer layers, then heads.
///
/// Nothing above the limit is built, so that a plan of billions of parameters can be priced on a
/// machine that could not hold them. Products of such widths run at one rate.
pub fn measurable(spec: &GeneratorSpec, codes: &Grid) -> GeneratorSpec {
    let mut small = spec.clone();
    let is_large = |spec: &GeneratorSpec| spec.params(codes).total() > MOST_PROBED_PARAMS;
    while is_large(&small) && small.shape().n_layer > 1 {
        let shape = small.shape_mut();
        shape.n_layer = shape.n_layer.div_ceil(2);
    }
    while is_large(&small) && small.shape().n_head > 1 {
        halve_heads(small.shape_mut());
    }
    small
}

/// Half of the heads, of the same width each, and as much less of the feed-forward width.
pub fn halve_heads(shape: &mut ModelShape) {
    let head_dim = shape.d_model / shape.n_head;
    let n_head = shape.n_head / 2;
    shape.d_ff = (shape.d_ff * n_head / shape.n_head).max(1);
    (shape.n_head, shape.d_model) = (n_head, n_head * head_dim);
}

/// FLOPs of a token of a small run, in the measure of the budget of the run that it stands for.
pub fn price_of_token(spec: &RunSpec, small: &RunSpec) -> f64 {
    let price = |run: &RunSpec| run.generator.flops_per_token(&run.codes, 0).openai as f64;
    price(small) / price(spec) * spec.budget_flops / spec.tokens() as f64
}
