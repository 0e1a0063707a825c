//! Cases of attention.

use super::*;

pub(super) fn options(
    lengths: &[usize],
    prefixes: &[usize],
    heads: [usize; 2],
) -> AttentionOptions {
    let [n_head, head_dim] = heads;
    let layout = Arc::new(SequenceLayout::new(lengths, prefixes).unwrap());
    let rope = Arc::new(Rope::new(layout.max_len(), head_dim, 10_000.0));
    AttentionOptions { n_head, layout, rope, epsilon: 1e-5 }
}

/// Sequences in blocks, each with its prefix; the angles of a sequence fall and rise.
fn block_options(sequences: &[(usize, &[usize])], heads: [usize; 2]) -> AttentionOptions {
    let [n_head, head_dim] = heads;
    let sequence = |(prefix, blocks): &(usize, &[usize])| {
        let n = prefix + blocks.iter().sum::<usize>();
        let angles = (0..n).map(|q| ((q * 5 + 3) % n) as u32).collect();
        BlockSequence { prefix: *prefix, blocks: (*blocks).into(), angles }
    };
    let sequences: Vec<BlockSequence> = sequences.iter().map(sequence).collect();
    let layout = Arc::new(SequenceLayout::in_blocks(&sequences).unwrap());
    let rope = Arc::new(Rope::new(layout.n_angles(), head_dim, 100.0));
    AttentionOptions { n_head, layout, rope, epsilon: 1e-5 }
}

pub(super) fn attention(
    lengths: &[usize],
    prefixes: &[usize],
    n_head: usize,
    head_dim: usize,
) -> Case {
    let name = format!("attention {lengths:?} {prefixes:?} {n_head} x {head_dim}");
    attention_of(name, options(lengths, prefixes, [n_head, head_dim]))
}

pub(super) fn block_attention(
    sequences: &[(usize, &[usize])],
    n_head: usize,
    head_dim: usize,
) -> Case {
    let name = format!("attention in blocks {sequences:?} {n_head} x {head_dim}");
    attention_of(name, block_options(sequences, [n_head, head_dim]))
}

fn attention_of(name: String, options: AttentionOptions) -> Case {
    let d = options.n_head * options.rope.head_dim();
    let n = options.layout.n_rows();
    let inputs = vec![input(n, d, 6), input(1, d, 2), input(d, 3 * d, 7), input(d, d, 8)];
    Case::new(name, inputs, move |kernels, x| {
        let [gamma_d, qkv_d3d, output_dd] = [&x[1], &x[2], &x[3]].map(Tensor::clone);
        let gamma_d = gamma_d.reshape([d]);
        let weights = AttentionWeights { gamma_d, qkv_d3d, output_dd };
        kernels.attention(x[0].clone(), weights, &options)
    })
}

pub(super) fn attend(
    lengths: &[usize],
    prefixes: &[usize],
    n_head: usize,
    head_dim: usize,
) -> Case {
    let options = options(lengths, prefixes, [n_head, head_dim]);
    let qkv = input(options.layout.n_rows(), 3 * n_head * head_dim, 6);
    let name = format!("attend {lengths:?} {prefixes:?} {n_head} x {head_dim}");
    Case::new(name, vec![qkv], move |kernels, x| kernels.attend(x[0].clone(), &options))
}

/// Sequences of queries with memories; the angles of a memory lie between those of its queries.
pub(super) fn cross_attend(sequences: &[[usize; 2]], is_turned: bool, heads: [usize; 2]) -> Case {
    let [n_head, head_dim] = heads;
    let [queries, memory]: [Vec<usize>; 2] =
        [0, 1].map(|part| sequences.iter().map(|counts| counts[part]).collect());
    let layout = Arc::new(CrossLayout::new(&queries, &memory));
    let angles = |counts: &[usize], step: f64| {
        let positions: Vec<f64> =
            (0..100).map(|t| t as f64 * step).take(counts.iter().copied().max().unwrap()).collect();
        Arc::new(Rope::at_positions(&positions, head_dim, 100.0))
    };
    let ropes = is_turned.then(|| [angles(&queries, 1.0), angles(&memory, 3.7)]);
    let d = n_head * head_dim;
    let inputs = vec![input(layout.n_queries(), d, 6), input(layout.n_memory(), 2 * d, 7)];
    let options = CrossOptions { n_head, layout, ropes };
    let name = format!("cross_attend {sequences:?} {heads:?}, turned: {is_turned}");
    Case::new(name, inputs, move |kernels, x| {
        kernels.cross_attend(x[0].clone(), x[1].clone(), &options)
    })
}
