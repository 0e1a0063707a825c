//! The count of FLOPs by which a sweep's prediction is brought onto its budget.

use isoflop::predict;
use isoflop::spec::flops::{TRAINING_PER_FORWARD, openai_per_token};
use isoflop::spec::{Ffn, ModelShape};

/// Training FLOPs by ScaMo's Code 1 along a ladder of shapes: what a token costs beside
/// its vocabulary is interpolated between rungs, in logarithms of N_nv; a code is chosen among
/// `head_share` of the vocabulary.
pub(super) fn openai_count(
    n_ctx: usize,
    head_share: f64,
    ladder: &[predict::Shape],
) -> impl Fn(f64, f64, f64) -> f64 + Sync {
    let rungs: Vec<(f64, f64)> = ladder
        .iter()
        .map(|rung| {
            let flops = openai_blocks(rung.n_layer as usize, rung.d_model as usize, n_ctx);
            ((rung.params_nonvocab() as f64).ln(), flops.ln())
        })
        .collect();
    move |nonvocab: f64, vocab: f64, tokens: f64| {
        let per_token = interpolate(&rungs, nonvocab.ln()).exp() + 2.0 * head_share * vocab;
        TRAINING_PER_FORWARD * per_token * tokens
    }
}

/// Forward FLOPs a token by the OpenAI rule beside the head, which depend on these numbers alone.
pub fn openai_blocks(n_layer: usize, d_model: usize, n_ctx: usize) -> f64 {
    let shape = ModelShape {
        n_layer,
        n_head: 1,
        d_model,
        d_ff: 0,
        n_ctx,
        d_text: 0,
        ffn: Ffn::SwiGlu,
        tie_embeddings: false,
        rope_base: 10_000.0,
    };
    openai_per_token(&shape, 0) as f64
}

/// Linear between the two nearest of at least two rising points, and beyond the ends.
fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let above = points.partition_point(|(at, _)| *at < x).clamp(1, points.len() - 1);
    let ((x0, y0), (x1, y1)) = (points[above - 1], points[above]);
    y0 + (y1 - y0) * (x - x0) / (x1 - x0)
}
