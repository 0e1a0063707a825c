//! Attention to a memory.

use std::ops::Range;

use burn::tensor::activation::softmax;
use burn::tensor::{Bool, Device, Tensor, TensorData};

use super::{MASKED, Product, integers, padded_of_rows, rotate, rows_of_padded};
use crate::ops::CrossOptions;

/// See [`Kernels::cross_attend`](crate::ops::Kernels::cross_attend): pads queries and memories to one
/// length where they differ.
pub fn cross_attention(
    queries_nd: Tensor<2>,
    key_values_m2d: Tensor<2>,
    options: &CrossOptions,
    product: Product,
) -> Tensor<2> {
    let CrossOptions { n_head, layout, ropes } = options;
    let ([_, d], device) = (queries_nd.dims(), queries_nd.device());
    let (b, c) = (layout.n_sequences(), d / n_head);
    let [of_queries, of_memory] =
        [layout.query_rows().collect::<Vec<_>>(), layout.memory_rows().collect()];
    let padded_md = pad(key_values_m2d, &of_memory);
    let by_head = |x_nd: Tensor<2>| {
        let t = x_nd.dims()[0] / b;
        x_nd.reshape([b, t, *n_head, c]).swap_dims(1, 2)
    };
    let part = |part: usize| by_head(padded_md.clone().narrow(1, part * d, d));
    let (mut queries, mut keys) = (by_head(pad(queries_nd, &of_queries)), part(0));
    if let Some([at_queries, at_memory]) = ropes {
        (queries, keys) = (rotate(queries, at_queries), rotate(keys, at_memory));
    }
    let scores = product.of(queries.div_scalar((c as f64).sqrt()), keys.swap_dims(2, 3));
    let scores = match padding(&of_memory, &device) {
        Some(hidden) => scores.clone().mask_fill(hidden.expand(scores.dims()), MASKED),
        None => scores,
    };
    let mixed = product.of(softmax(scores, 3), part(1)).swap_dims(1, 2);
    let [_, t, ..] = mixed.dims();
    unpad(mixed.reshape([b * t, d]), &of_queries)
}

fn longest(sequences: &[Range<usize>]) -> usize {
    sequences.iter().map(Range::len).max().unwrap_or(0)
}

fn is_even(sequences: &[Range<usize>]) -> bool {
    sequences.iter().all(|rows| rows.len() == sequences[0].len())
}

/// Rows of sequences of one length, those that are too short filled up with their first row.
fn pad(x_nd: Tensor<2>, sequences: &[Range<usize>]) -> Tensor<2> {
    if is_even(sequences) {
        return x_nd;
    }
    let rows = integers(rows_of_padded(sequences, longest(sequences)), &x_nd.device());
    x_nd.select(0, rows)
}

/// Takes out again what [`pad`] has put in.
fn unpad(x_nd: Tensor<2>, sequences: &[Range<usize>]) -> Tensor<2> {
    if is_even(sequences) {
        return x_nd;
    }
    let rows = integers(padded_of_rows(sequences, longest(sequences)), &x_nd.device());
    x_nd.select(0, rows)
}

/// True where a row of a memory is padding, `[b, 1, 1, t]`; `None` where none is.
fn padding(sequences: &[Range<usize>], device: &Device) -> Option<Tensor<4, Bool>> {
    let t = longest(sequences);
    let hidden = |rows: &Range<usize>| (0..t).map(|i| i >= rows.len()).collect::<Vec<_>>();
    let hidden: Vec<bool> = sequences.iter().flat_map(hidden).collect();
    let data = TensorData::new(hidden, [sequences.len(), 1, 1, t]);
    (!is_even(sequences)).then(|| Tensor::from_data(data, device))
}
