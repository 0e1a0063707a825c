//! Models and vocabularies that can be built, as near as may be to sizes that a law asks for.

use anyhow::{Context, Result};
use isoflop::predict::Codebook;
use isoflop::spec::CodebookKind;
use isoflop::sweep::{LevelsSpec, ModelEntry, Sweep, VocabSpec, models, shape};

/// Widths beyond which no model is looked for.
const WIDEST: usize = 1 << 15;

/// Each value once, in the order of its first.
pub fn distinct<T: PartialEq>(values: Vec<T>) -> Vec<T> {
    values.into_iter().fold(Vec::new(), |mut kept, value| {
        if !kept.contains(&value) {
            kept.push(value);
        }
        kept
    })
}

/// V codes in all codebooks together, as near as the sweep's quantizer has them.
pub fn codes(n_vocab: f64, sweep: &Sweep) -> VocabSpec {
    let quantizer = sweep.tokenizer.quantizer();
    let n_vocab = n_vocab / quantizer.n_codebooks() as f64;
    match quantizer.codebook_kind() {
        CodebookKind::Fsq if sweep.has_tokenizers() => {
            let levels = Codebook::near(n_vocab).levels;
            VocabSpec::Levels(LevelsSpec { levels: levels.iter().map(|l| *l as usize).collect() })
        }
        _ => VocabSpec::Size(n_vocab.round().max(2.0) as usize),
    }
}

/// The model of the sweep's family whose N_nv is nearest: depth and heads are those of the nearest
/// model tried, the width follows.
pub fn model(sweep: &Sweep, params_nonvocab: f64) -> Result<ModelEntry> {
    let off = |entry: &ModelEntry| (nonvocab(sweep, entry) / params_nonvocab).ln().abs();
    let nearer = |a: &ModelEntry, b: &ModelEntry| off(a).total_cmp(&off(b));
    let tried = models(&sweep.grid.models);
    let nearest = tried.iter().min_by(|a, b| nearer(a, b)).context("the sweep has no models")?;
    // The rotary positions want an even width of a head.
    let step = 2 * nearest.n_head;
    let of_width = |d_model| ModelEntry { d_model, d_ff: None, ..nearest.clone() };
    let widths = (step..WIDEST).step_by(step).map(of_width);
    widths.min_by(|a, b| nearer(a, b)).context("no width that can be built")
}

/// N_nv of a model, which does not depend on its vocabulary.
pub fn nonvocab(sweep: &Sweep, entry: &ModelEntry) -> f64 {
    shape(entry, &sweep.model, &sweep.text).params_of(1).nonvocab as f64
}
