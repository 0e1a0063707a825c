//! Whether shapes fit one another: the same sentences for every implementation.

use super::{Activation, AttentionOptions, Convolution, CrossOptions, Rope, Taps};

pub fn attention(
    [n, d]: [usize; 2],
    [_, columns]: [usize; 2],
    AttentionOptions { n_head, layout, rope, .. }: &AttentionOptions,
) {
    let (rows, head_dim) = (layout.n_rows(), rope.head_dim());
    assert_eq!(n, rows, "attention: {n} rows for a layout of {rows}");
    assert!(
        d == n_head * head_dim && columns == 3 * d,
        "attention: {columns} columns are not [q | k | v] of {n_head} heads of {head_dim}"
    );
    let (places, max_len) = (layout.n_angles(), rope.max_len());
    assert!(places <= max_len, "attention: {places} positions, angles for {max_len}");
}

pub fn cross_attention(
    [n, d]: [usize; 2],
    [m, columns]: [usize; 2],
    CrossOptions { n_head, layout, ropes }: &CrossOptions,
) {
    let rows = [layout.n_queries(), layout.n_memory()];
    assert_eq!([n, m], rows, "cross_attend: queries and memory of the layout");
    assert_eq!(columns, 2 * d, "cross_attend: [k | v] beside queries of {d} columns");
    assert!(d.is_multiple_of(*n_head), "cross_attend: {n_head} heads in {d} columns");
    let Some([of_queries, of_memory]) = ropes else { return };
    let angles = |rope: &Rope| (rope.head_dim() == d / n_head).then(|| rope.max_len());
    let fits = |rope, longest: Option<usize>| angles(rope) >= longest;
    let queries = layout.query_rows().map(|rows| rows.len()).max();
    let memory = layout.memory_rows().map(|rows| rows.len()).max();
    assert!(
        fits(of_queries, queries) && fits(of_memory, memory),
        "cross_attend: an angle for each row of a head"
    );
}

pub fn feed_forward(
    [_, d]: [usize; 2],
    [rows, u]: [usize; 2],
    [f, columns]: [usize; 2],
    activation: Activation,
) {
    let wanted = match activation {
        Activation::SwiGlu => 2 * f,
        Activation::Gelu => f,
    };
    assert_eq!(
        [rows, columns, u],
        [d, d, wanted],
        "feed_forward: rows of {d}, {f} hidden features"
    );
}

pub fn convolution(
    [n, c]: [usize; 2],
    [rows, o]: [usize; 2],
    [columns]: [usize; 1],
    Convolution { n_clips, taps, .. }: Convolution,
) {
    assert_eq!([rows, o], [taps.count() * c, columns], "convolve: {c} channels, {taps:?}");
    assert!(n_clips > 0 && n.is_multiple_of(n_clips), "convolve: {n} rows of {n_clips} clips");
    let whole = taps != Taps::Halving || (n / n_clips).is_multiple_of(2);
    assert!(whole, "clips are cropped to whole tokens before they are encoded");
}

pub fn targets([n, n_vocab]: [usize; 2], targets: &[u32]) {
    assert!(n > 0, "cross_entropy: no rows to average over");
    assert_eq!(n, targets.len(), "cross_entropy: {} targets for {n} rows", targets.len());
    let largest = targets.iter().max().map_or(0, |&target| target as usize);
    assert!(largest < n_vocab, "cross_entropy: target {largest} in a vocabulary of {n_vocab}");
}
