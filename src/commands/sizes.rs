//! Where an optimum is expected before anything is trained ([`Expected`]), and the models and vocabularies that can be
//! built nearest to sizes that a law asks for.

use super::prelude::*;
use isoflop::laws::scamo;
use isoflop::predict::Codebook;
use isoflop::spec::CodebookKind;
use isoflop::sweep::{LevelsSpec, ModelEntry, VocabSpec, models, shape};

/// N_nv and N_v of the optimum at 1e11 FLOPs and their exponents in C, as this program's own studies of motion
/// found them (`results/procedural-law`, `results/cmu-motion`): where to look, and no more.
const NONVOCAB: (f64, f64) = (7.0e3, 0.45);
const VOCAB: (f64, f64) = (2.6e4, 0.57);
/// The largest budget that the own studies say something of, and the smallest of the published law.
const OWN_UP_TO: f64 = 1e14;
const PUBLISHED_FROM: f64 = 1e15;

/// The optimum that a law expects at a budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    /// The law, for a person.
    pub by: &'static str,
    /// Factor within which V may be otherwise: tokenizers differ.
    pub vocab_within: f64,
}

impl Expected {
    /// By the own studies, however large the budget.
    pub fn by_own_studies(budget: f64) -> Self {
        let law = |(at, exponent): (f64, f64)| at * (budget / 1e11).powf(exponent);
        Self {
            params_nonvocab: law(NONVOCAB),
            params_vocab: law(VOCAB),
            by: "the law of small studies of motion",
            vocab_within: 2.5,
        }
    }

    /// By the law that has something to say of a budget; `None` between the two.
    pub fn of(budget: f64) -> Option<Self> {
        if budget <= OWN_UP_TO {
            return Some(Self::by_own_studies(budget));
        }
        let laws = scamo().power_laws;
        (budget >= PUBLISHED_FROM).then_some(Self {
            params_nonvocab: laws.params_nonvocab?.value_at(budget),
            params_vocab: laws.params_vocab?.value_at(budget),
            by: "the published law",
            vocab_within: 1.0,
        })
    }
}

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
