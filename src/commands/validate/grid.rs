//! The cells round a predicted optimum.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use isoflop::predict::Prediction;
use isoflop::sweep::{
    Clips, GridSection, HoldOutSpec, ModelEntry, ModelList, Origin, Sweep, VocabSpec,
};

use crate::commands::buildable::{codes, distinct, model};

/// The factors between the forecast's size, or vocabulary, and its neighbours where no interval is known.
const SIZE_STEP: f64 = 1.6;
const VOCAB_STEP: f64 = 2.0;
/// How far beyond the ends of an interval the outermost cells lie: a forecast that is wrong by so much fails.
const BEYOND: f64 = 2.0;
/// How far from the forecast they lie at most: cells farther apart tell no valley.
const FARTHEST: f64 = 8.0;

/// The sweep of a forecast's configuration, of sizes within and beyond its interval, and of vocabularies:
/// trained as the sweep's own runs are, with more data where it is made on demand.
pub fn around(sweep: &Sweep, forecast: &Prediction, name: &str, seeds: &[u64]) -> Result<Sweep> {
    let (Some(size), Some(vocab)) = (forecast.at.params_nonvocab, forecast.at.n_vocab) else {
        bail!("the laws of {} tell no vocabulary, so there is nothing to build", sweep.name);
    };
    let sizes = levels(size, forecast.ci95.at.params_nonvocab, SIZE_STEP);
    let sizes: Vec<ModelEntry> =
        sizes.iter().map(|size| model(sweep, *size)).collect::<Result<_>>()?;
    let vocabularies = match &sweep.grid.vocab[..] {
        // One vocabulary is the trainer's own, or was chosen: the forecast is of no other.
        [only] => vec![only.clone(); 2 * MIDDLE + 1],
        _ => levels(vocab, forecast.ci95.at.n_vocab, VOCAB_STEP).map(|v| codes(v, sweep)).to_vec(),
    };
    // Half of a small vocabulary may leave a codebook without codes.
    let buildable = vocabularies.iter().filter(|codes| sweep.quantizer(codes).is_ok());
    let mut own = sweep.clone();
    own.name = name.to_string();
    own.grid = GridSection {
        exclude: corners(&sizes[MIDDLE], &vocabularies[MIDDLE], sweep)?,
        models: ModelList::List(distinct(sizes)),
        vocab: distinct(buildable.cloned().collect()),
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

/// Cells of a cross of such sizes and vocabularies.
pub fn cells(cross: &Sweep) -> usize {
    let sizes = match &cross.grid.models {
        ModelList::List(models) => models.len(),
        _ => 1,
    };
    sizes + cross.grid.vocab.len() - 1
}

/// The forecast's place among [`levels`].
const MIDDLE: usize = 2;

/// A value, two beyond the ends of its interval, and two halfway there in logarithms.
fn levels(value: f64, interval: Option<[f64; 2]>, step: f64) -> [f64; 5] {
    let [low, high] = interval.unwrap_or([value, value]);
    let low = (low / BEYOND).min(value / step.powi(2)).max(value / FARTHEST);
    let high = (high * BEYOND).max(value * step.powi(2)).min(value * FARTHEST);
    [low, (low * value).sqrt(), value, (value * high).sqrt(), high]
}

/// A cell lies on the cross through the middle: what is off it on both axes is left out.
fn corners(model: &ModelEntry, vocabulary: &VocabSpec, sweep: &Sweep) -> Result<Vec<String>> {
    let (n_vocab, d_model) = (sweep.quantizer(vocabulary)?.n_vocab(), model.d_model);
    let sides = ["<", ">"];
    let pairs = sides.iter().flat_map(|size| sides.map(|vocab| (size, vocab)));
    let corner = |(size, vocab): (&&str, &str)| {
        format!("d_model {size} {d_model} and n_vocab {vocab} {n_vocab}")
    };
    Ok(pairs.map(corner).collect())
}

#[cfg(test)]
mod tests {
    use super::levels;

    #[test]
    fn cells_lie_beyond_both_ends_of_an_interval_so_that_a_forecast_can_fail() {
        let [low, below, middle, above, high] = levels(100.0, Some([50.0, 300.0]), 1.6);
        assert_eq!([low, middle, high], [25.0, 100.0, 600.0]);
        assert!(low < below && below < middle && middle < above && above < high);
        let [low, .., high] = levels(100.0, None, 2.0);
        assert_eq!([low, high], [25.0, 400.0]);
        let [low, .., high] = levels(100.0, Some([1.0, 1e5]), 2.0);
        assert_eq!([low, high], [12.5, 800.0], "an interval that knows nothing");
    }
}
