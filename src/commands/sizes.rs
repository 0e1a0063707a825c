//! The expected optimum before any training ([`Expected`]), and the models and vocabularies that can be built
//! nearest to given sizes.

use super::prelude::*;
use isoflop::laws::scamo;
use isoflop::predict::Codebook;
use isoflop::spec::CodebookKind;
use isoflop::sweep::{LevelsSpec, ModelEntry, VocabSpec, models, shape};

/// N_nv and N_v of the optimum at 1e11 FLOPs and their exponents in C, from this project's studies
/// (`results/procedural-law`, `results/cmu-motion`): a rough guess, used to place grids.
const NONVOCAB: (f64, f64) = (7.0e3, 0.45);
const VOCAB: (f64, f64) = (2.6e4, 0.57);
/// The largest budget for which the project's studies are used, and the smallest for the published law.
const OWN_UP_TO: f64 = 1e14;
const PUBLISHED_FROM: f64 = 1e15;

/// The optimum that a law expects at a budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    /// The law's name.
    pub by: &'static str,
    /// Factor of uncertainty of V: tokenizers differ.
    pub vocab_within: f64,
}

impl Expected {
    /// By the project's studies, at any budget.
    pub fn by_own_studies(budget: f64) -> Self {
        let law = |(at, exponent): (f64, f64)| at * (budget / 1e11).powf(exponent);
        Self {
            params_nonvocab: law(NONVOCAB),
            params_vocab: law(VOCAB),
            by: "the law of small studies of motion",
            vocab_within: 2.5,
        }
    }

    /// By the law that covers a budget; `None` between the two.
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

/// The distinct values, in order of first occurrence.
pub fn distinct<T: PartialEq>(values: Vec<T>) -> Vec<T> {
    values.into_iter().fold(Vec::new(), |mut kept, value| {
        if !kept.contains(&value) {
            kept.push(value);
        }
        kept
    })
}

/// The nearest number of codes that the sweep's quantizer can have.
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

/// The model of the sweep's family with the nearest N_nv: depth and heads of the nearest model tried, at another
/// width.
pub fn model(sweep: &Sweep, params_nonvocab: f64) -> Result<ModelEntry> {
    let off = |entry: &ModelEntry| (nonvocab(sweep, entry) / params_nonvocab).ln().abs();
    let nearer = |a: &ModelEntry, b: &ModelEntry| off(a).total_cmp(&off(b));
    let tried = models(&sweep.grid.models);
    let nearest = tried.iter().min_by(|a, b| nearer(a, b)).context("the sweep has no models")?;
    // Rotary positions need an even width per head.
    let step = 2 * nearest.n_head;
    let of_width = |d_model| ModelEntry { d_model, d_ff: None, ..nearest.clone() };
    let widths = (step..WIDEST).step_by(step).map(of_width);
    widths.min_by(|a, b| nearer(a, b)).context("no width that can be built")
}

/// N_nv of a model, which does not depend on its vocabulary.
pub fn nonvocab(sweep: &Sweep, entry: &ModelEntry) -> f64 {
    shape(entry, &sweep.model, &sweep.text).params_of(1).nonvocab as f64
}
