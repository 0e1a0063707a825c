//! The published runs, for tests.

use super::TokensPerCharacter;
use crate::laws::input::metric::Metric;
use crate::laws::input::point::{IsoFlopPoint, RunFacts};

const TABLE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../../shared/data/runs/scaling_with_vocab/exp_data.csv"
);

/// The 1200 runs of Tao et al. in the order of their file; none, with a message, without the file.
pub fn published() -> Option<Vec<IsoFlopPoint>> {
    let Ok(text) = std::fs::read_to_string(TABLE) else {
        eprintln!("skipped: {TABLE} is not here");
        return None;
    };
    Some(text.lines().skip(1).map(from_line).collect())
}

/// `vocab_size, embed_dim, num_characters, Non_vocab_parameters, FLOPs, Lossu`.
fn from_line(line: &str) -> IsoFlopPoint {
    let cells: Vec<f64> = line.split(',').map(|cell| cell.trim().parse().unwrap()).collect();
    let [n_vocab, d, characters, params_nonvocab, flops, loss] = cells[..] else {
        panic!("six columns: {line}");
    };
    let tokens = characters * TokensPerCharacter::TAO.at(n_vocab);
    IsoFlopPoint { flops, ..run(params_nonvocab, n_vocab, d, tokens, loss) }
}

pub fn run(params_nonvocab: f64, n_vocab: f64, d: f64, tokens: f64, loss: f64) -> IsoFlopPoint {
    let params_vocab = n_vocab * d;
    let flops = 6.0 * (params_nonvocab + params_vocab) * tokens;
    IsoFlopPoint {
        run_id: format!("n{params_nonvocab}-v{n_vocab}-d{tokens}"),
        seed: 0,
        budget_flops: flops,
        flops,
        params_nonvocab,
        params_vocab,
        n_vocab,
        tokens,
        metric: Metric::default(),
        loss,
        weight: 1.0,
        about: RunFacts::default(),
    }
}
