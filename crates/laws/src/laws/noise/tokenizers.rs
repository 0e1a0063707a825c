//! Tokenizer noise: the spread of losses between tokenizers of the same vocabulary.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::laws::input::budget::Budget;
use crate::laws::maths::stats::Normals;
use crate::laws::minima::{NoiseSource, RunNoise};

/// The scatter of tokenizers: it moves all runs of a tokenizer together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TokenizerNoise {
    /// Standard deviation of the losses with one tokenizer, in nats.
    pub sd: f64,
    /// Degrees of freedom of its square: tokenizers less vocabularies.
    pub dof: usize,
    /// V, and how many tokenizers its runs have.
    pub tokenizers: Vec<(f64, usize)>,
}

impl TokenizerNoise {
    /// The standard deviation of the mean over the tokenizers of a vocabulary.
    pub(in crate::laws) fn of_mean(&self, n_vocab: f64) -> f64 {
        let found = self.tokenizers.iter().find(|(v, _)| *v == n_vocab);
        self.sd / (found.map_or(1, |(_, n)| *n) as f64).sqrt()
    }

    /// The shift of all runs of each vocabulary in a replicate.
    pub(in crate::laws) fn shifts(&self, normals: &mut Normals) -> Shifts {
        let scale = (self.dof as f64 / normals.chi_square(self.dof)).sqrt();
        let shift = |(v, _): &(f64, usize)| (*v, scale * self.of_mean(*v) * normals.draw());
        Shifts(self.tokenizers.iter().map(shift).collect())
    }
}

/// V, and the shift of all its runs.
#[derive(Default)]
pub(in crate::laws) struct Shifts(Vec<(f64, f64)>);

impl Shifts {
    /// 0 for a vocabulary that has none.
    pub fn of(&self, n_vocab: f64) -> f64 {
        self.0.iter().find(|(v, _)| *v == n_vocab).map_or(0.0, |(_, shift)| *shift)
    }
}

/// V as a key.
type Vocabulary = u64;

/// A cell whose runs have several tokenizers.
struct Compared<'a> {
    vocabulary: Vocabulary,
    /// The losses of each tokenizer's runs.
    losses: BTreeMap<&'a str, Vec<f64>>,
    /// The mean over tokenizers.
    mean: f64,
}

impl<'a> Compared<'a> {
    /// Each tokenizer, its runs, and how far their mean lies from the cell's.
    fn offsets(&self) -> Vec<((Vocabulary, &'a str), usize, f64)> {
        let offset = |(id, losses): (&&'a str, &Vec<f64>)| {
            ((self.vocabulary, *id), losses.len(), mean(losses) - self.mean)
        };
        self.losses.iter().map(offset).collect()
    }
}

/// The scatter between tokenizers of one vocabulary, each by the mean of its distances from the others
/// over all cells; none if no vocabulary has two.
pub(in crate::laws) fn tokenizer_noise(budgets: &[Budget]) -> Option<TokenizerNoise> {
    let cells: Vec<Compared> = budgets.iter().flat_map(cells).collect();
    let offsets = mean_offsets(&cells);
    let squares: f64 = offsets.values().map(|offset| offset.powi(2)).sum();
    let dof = offsets.len().checked_sub(vocabularies(&offsets).len())?;
    let mut seen: BTreeMap<Vocabulary, BTreeSet<&str>> = BTreeMap::new();
    for point in budgets.iter().flat_map(|budget| &budget.points) {
        let ids = seen.entry(point.n_vocab.to_bits()).or_default();
        ids.extend(point.about.tokenizer.as_deref());
    }
    let tokenizers = seen.into_iter().map(|(v, ids)| (f64::from_bits(v), ids.len().max(1)));
    let tokenizers = tokenizers.collect();
    (dof > 0).then(|| TokenizerNoise { sd: (squares / dof as f64).sqrt(), dof, tokenizers })
}

/// Run noise, by runs of one cell with several tokenizers minus the effect of each tokenizer; `None` if no vocabulary
/// has two.
///
/// Only the better half of each budget's cells is used, near the minimum: runs of few steps, far above it, scatter
/// more.
pub(in crate::laws) fn runs_beside_tokenizers(budgets: &[Budget]) -> Option<RunNoise> {
    let better = |budget| {
        let mut cells = cells(budget);
        cells.sort_by(|a, b| a.mean.total_cmp(&b.mean));
        cells.truncate(cells.len().div_ceil(2));
        cells
    };
    let cells: Vec<Compared> = budgets.iter().flat_map(better).collect();
    let offsets = mean_offsets(&cells);
    let own = cells.iter().flat_map(Compared::offsets);
    let squares: f64 = own.map(|(id, runs, x)| runs as f64 * (x - offsets[&id]).powi(2)).sum();
    let compared: usize = cells.iter().map(|cell| cell.losses.len() - 1).sum();
    let dof = compared.checked_sub(offsets.len() - vocabularies(&offsets).len())?;
    let source = NoiseSource::Tokenizers;
    (dof > 0).then(|| RunNoise { sd: (squares / dof as f64).sqrt(), dof, source })
}

/// The effect of each tokenizer on its runs, relative to the others of its vocabulary.
fn mean_offsets<'a>(cells: &[Compared<'a>]) -> BTreeMap<(Vocabulary, &'a str), f64> {
    let mut all: BTreeMap<(Vocabulary, &str), Vec<f64>> = BTreeMap::new();
    for (id, _, offset) in cells.iter().flat_map(Compared::offsets) {
        all.entry(id).or_default().push(offset);
    }
    all.into_iter().map(|(id, offsets)| (id, mean(&offsets))).collect()
}

fn vocabularies(offsets: &BTreeMap<(Vocabulary, &str), f64>) -> BTreeSet<Vocabulary> {
    offsets.keys().map(|(vocabulary, _)| *vocabulary).collect()
}

/// The cells of a budget that have several tokenizers.
fn cells<'a>(budget: &'a Budget<'a>) -> Vec<Compared<'a>> {
    let mut cells: BTreeMap<[u64; 2], BTreeMap<&str, Vec<f64>>> = BTreeMap::new();
    for point in &budget.points {
        let Some(tokenizer) = &point.about.tokenizer else { continue };
        let key = [point.n_vocab.to_bits(), point.params_nonvocab.to_bits()];
        cells.entry(key).or_default().entry(tokenizer).or_default().push(point.loss);
    }
    let compared = |([vocabulary, _], losses): ([u64; 2], BTreeMap<&'a str, Vec<f64>>)| {
        let means: Vec<f64> = losses.values().map(|losses| mean(losses)).collect();
        let mean = mean(&means);
        (losses.len() > 1).then_some(Compared { vocabulary, losses, mean })
    };
    cells.into_iter().filter_map(compared).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::input::{IsoFlopPoint, RunFacts, group_budgets};
    use crate::laws::simulated::{SWEEP, Simulated};

    /// A sweep of three tokenizers a vocabulary that scatter by `sd`.
    fn points(sd: f64) -> Vec<IsoFlopPoint> {
        let with = |tokenizer: u64| {
            let seeded = Simulated { seed: tokenizer, ..SWEEP }.points();
            seeded.into_iter().map(move |point| {
                let shift = Normals::of_stream(point.n_vocab as u64, tokenizer).draw();
                let id = Some(format!("{} {tokenizer}", point.n_vocab));
                let about = RunFacts { tokenizer: id, ..RunFacts::default() };
                IsoFlopPoint { loss: point.loss + sd * shift, about, ..point }
            })
        };
        (0..3).flat_map(with).collect()
    }

    #[test]
    fn the_scatter_of_tokenizers_is_recovered_beside_that_of_runs() {
        let points = points(0.05);
        let noise = tokenizer_noise(&group_budgets(&points).unwrap()).unwrap();
        assert_eq!((noise.dof, noise.tokenizers.len(), noise.tokenizers[0].1), (10, 5, 3));
        assert!((noise.sd / 0.05 - 1.0).abs() < 0.5, "{noise:?}");
        let runs = runs_beside_tokenizers(&group_budgets(&points).unwrap()).unwrap();
        assert!((runs.sd / SWEEP.noise - 1.0).abs() < 0.2, "{runs:?}");
        assert!((noise.of_mean(2500.0) * 3f64.sqrt() / noise.sd - 1.0).abs() < 1e-12);
    }

    #[test]
    fn one_tokenizer_a_vocabulary_knows_nothing_of_others() {
        assert_eq!(tokenizer_noise(&group_budgets(&SWEEP.points()).unwrap()), None);
    }
}
