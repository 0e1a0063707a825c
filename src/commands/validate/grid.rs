//! The cells round a predicted optimum.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use isoflop::predict::Prediction;
use isoflop::sweep::{
    Clips, GridSection, HoldOutSpec, ModelEntry, ModelList, Origin, Sweep, VocabSpec,
};

use crate::commands::buildable::{codes, distinct, model};

/// The factor between neighbouring sizes, and between neighbouring vocabularies.
const SIZE_STEP: f64 = 1.6;
const VOCAB_STEP: f64 = 2.0;
/// The forecast's configuration, two sizes beside it and two vocabularies.
pub const CELLS: usize = 5;

/// The sweep of a forecast's configuration, its neighbours in size and those in vocabulary: five
/// cells, trained as the sweep's own are, with more data where it is made on demand.
pub fn around(sweep: &Sweep, forecast: &Prediction, name: &str, seeds: &[u64]) -> Result<Sweep> {
    let (Some(size), Some(vocab)) = (forecast.params_nonvocab, forecast.n_vocab) else {
        bail!("the laws of {} tell no vocabulary, so there is nothing to build", sweep.name);
    };
    let sizes = [size / SIZE_STEP, size, size * SIZE_STEP];
    let sizes: Vec<ModelEntry> =
        sizes.iter().map(|size| model(sweep, *size)).collect::<Result<_>>()?;
    let vocabularies = [vocab / VOCAB_STEP, vocab, vocab * VOCAB_STEP].map(|v| codes(v, sweep));
    let mut own = sweep.clone();
    own.name = name.to_string();
    own.grid = GridSection {
        exclude: corners(&sizes, &vocabularies, sweep)?,
        models: ModelList::List(distinct(sizes)),
        vocab: distinct(vocabularies.to_vec()),
        budgets: vec![forecast.budget_flops],
        shares: vec![1.0],
        zip: Vec::new(),
        vary: BTreeMap::new(),
        also: Vec::new(),
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

/// A cell lies on the cross through the middle: what is off it on both axes is left out.
fn corners(sizes: &[ModelEntry], vocabularies: &[VocabSpec], sweep: &Sweep) -> Result<Vec<String>> {
    let n_vocab = sweep.quantizer(&vocabularies[1])?.n_vocab();
    let d_model = sizes[1].d_model;
    let sides = ["<", ">"];
    let pairs = sides.iter().flat_map(|size| sides.map(|vocab| (size, vocab)));
    let corner = |(size, vocab): (&&str, &str)| {
        format!("d_model {size} {d_model} and n_vocab {vocab} {n_vocab}")
    };
    Ok(pairs.map(corner).collect())
}
