//! The cells round a predicted optimum.

use anyhow::{Context, Result, bail};
use isoflop::predict::{Codebook, Prediction};
use isoflop::spec::{CodebookKind, QuantizerSection};
use isoflop::sweep::{
    Clips, GridSection, HoldOutSpec, LevelsSpec, ModelEntry, ModelList, Origin, Sweep, VocabSpec,
    models, shape,
};

/// The factor between neighbouring sizes, and between neighbouring vocabularies.
const SIZE_STEP: f64 = 1.6;
const VOCAB_STEP: f64 = 2.0;
/// Widths beyond which no model is looked for.
const WIDEST: usize = 1 << 15;

/// The sweep of a forecast's configuration, its neighbours in size and those in vocabulary: five
/// cells, trained as the sweep's own are, with more data where it is made on demand.
pub fn around(sweep: &Sweep, forecast: &Prediction, name: &str, seeds: &[u64]) -> Result<Sweep> {
    let (Some(size), Some(vocab)) = (forecast.params_nonvocab, forecast.n_vocab) else {
        bail!("the laws of {} tell no vocabulary, so there is nothing to build", sweep.name);
    };
    let sizes = [size / SIZE_STEP, size, size * SIZE_STEP];
    let sizes: Vec<ModelEntry> =
        sizes.iter().map(|size| model(sweep, *size)).collect::<Result<_>>()?;
    let quantizer = sweep.tokenizer.quantizer();
    let vocabularies =
        [vocab / VOCAB_STEP, vocab, vocab * VOCAB_STEP].map(|v| codes(v, &quantizer));
    let mut own = sweep.clone();
    own.name = name.to_string();
    own.grid = GridSection {
        exclude: corners(&sizes, &vocabularies, &quantizer)?,
        models: ModelList::List(distinct(sizes)),
        vocab: distinct(vocabularies.to_vec()),
        budgets: vec![forecast.budget_flops],
        zip: Vec::new(),
    };
    if !seeds.is_empty() {
        own.seeds = seeds.to_vec();
    }
    if own.data.origin() == Origin::Procedural {
        own.data.clips = Clips::Auto;
    }
    own.fit.hold_out = HoldOutSpec::None;
    own.fit.bootstrap = 0;
    own.predict.budgets = Vec::new();
    Ok(own)
}

fn distinct<T: PartialEq>(values: Vec<T>) -> Vec<T> {
    values.into_iter().fold(Vec::new(), |mut kept, value| {
        if !kept.contains(&value) {
            kept.push(value);
        }
        kept
    })
}

/// A cell lies on the cross through the middle: what is off it on both axes is left out.
fn corners(
    sizes: &[ModelEntry],
    vocabularies: &[VocabSpec],
    quantizer: &QuantizerSection,
) -> Result<Vec<String>> {
    let n_vocab = vocabularies[1].quantizer(quantizer)?.n_vocab();
    let d_model = sizes[1].d_model;
    let sides = ["<", ">"];
    let pairs = sides.iter().flat_map(|size| sides.map(|vocab| (size, vocab)));
    let corner = |(size, vocab): (&&str, &str)| {
        format!("d_model {size} {d_model} and n_vocab {vocab} {n_vocab}")
    };
    Ok(pairs.map(corner).collect())
}

/// V codes in all codebooks together, as near as the quantizer has them.
fn codes(n_vocab: f64, quantizer: &QuantizerSection) -> VocabSpec {
    let n_vocab = n_vocab / quantizer.n_codebooks() as f64;
    match quantizer.codebook_kind() {
        CodebookKind::Fsq => {
            let levels = Codebook::near(n_vocab).levels;
            VocabSpec::Levels(LevelsSpec { levels: levels.iter().map(|l| *l as usize).collect() })
        }
        CodebookKind::Vq => VocabSpec::Size(n_vocab.round().max(2.0) as usize),
    }
}

/// The model of the sweep's family whose N_nv is nearest: depth and heads are those of the nearest
/// model tried, the width follows.
fn model(sweep: &Sweep, params_nonvocab: f64) -> Result<ModelEntry> {
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
fn nonvocab(sweep: &Sweep, entry: &ModelEntry) -> f64 {
    shape(entry, &sweep.model, &sweep.text).params_of(1).nonvocab as f64
}
