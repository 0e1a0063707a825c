//! How much one tokenizer's loss differs from another's of the same vocabulary.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Budget;

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
    pub(super) fn of_mean(&self, n_vocab: f64) -> f64 {
        let found = self.tokenizers.iter().find(|(v, _)| *v == n_vocab);
        self.sd / (found.map_or(1, |(_, n)| *n) as f64).sqrt()
    }
}

/// V as a key.
type Vocabulary = u64;

/// The scatter between tokenizers of one vocabulary, each by the mean of its distances from the others
/// over all cells; none where no vocabulary has two.
pub(super) fn tokenizer_noise(budgets: &[Budget]) -> Option<TokenizerNoise> {
    let mut offsets: BTreeMap<(Vocabulary, &str), Vec<f64>> = BTreeMap::new();
    let mut seen: BTreeMap<Vocabulary, Vec<&str>> = BTreeMap::new();
    for cell in cells(budgets) {
        let grand = mean(&cell.values().map(|losses| mean(losses)).collect::<Vec<_>>());
        for ((vocabulary, tokenizer), losses) in &cell {
            seen.entry(*vocabulary).or_default().push(tokenizer);
            if cell.len() > 1 {
                offsets.entry((*vocabulary, tokenizer)).or_default().push(mean(losses) - grand);
            }
        }
    }
    let squares: f64 = offsets.values().map(|offsets| mean(offsets).powi(2)).sum();
    let compared: BTreeMap<Vocabulary, usize> =
        offsets.keys().fold(BTreeMap::new(), |mut counts, (vocabulary, _)| {
            *counts.entry(*vocabulary).or_insert(0) += 1;
            counts
        });
    let dof = compared.values().map(|tokenizers| tokenizers - 1).sum();
    let tokenizers = seen.into_iter().map(|(vocabulary, mut ids)| {
        ids.sort_unstable();
        ids.dedup();
        (f64::from_bits(vocabulary), ids.len())
    });
    let tokenizers = tokenizers.collect();
    (dof > 0).then(|| TokenizerNoise { sd: (squares / dof as f64).sqrt(), dof, tokenizers })
}

/// The losses of each cell's tokenizers.
fn cells<'a>(
    budgets: &'a [Budget<'a>],
) -> impl Iterator<Item = BTreeMap<(Vocabulary, &'a str), Vec<f64>>> {
    let mut cells: BTreeMap<[u64; 3], BTreeMap<(Vocabulary, &str), Vec<f64>>> = BTreeMap::new();
    for point in budgets.iter().flat_map(|budget| &budget.points) {
        let Some(tokenizer) = &point.about.tokenizer else { continue };
        let vocabulary = point.n_vocab.to_bits();
        let key = [point.budget_flops.to_bits(), point.params_nonvocab.to_bits(), vocabulary];
        let cell = cells.entry(key).or_default();
        cell.entry((vocabulary, tokenizer.as_str())).or_default().push(point.loss);
    }
    cells.into_values()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::random::Normals;
    use crate::laws::simulated::{SWEEP, Simulated};
    use crate::laws::{IsoFlopPoint, RunFacts, group_budgets};

    /// A sweep of three tokenizers a vocabulary that scatter by `sd`.
    fn points(sd: f64) -> Vec<IsoFlopPoint> {
        let with = |tokenizer: u64| {
            let seeded = Simulated { seed: tokenizer, ..SWEEP }.points();
            seeded.into_iter().map(move |point| {
                let shift = Normals::of_stream(point.n_vocab as u64, tokenizer).next();
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
        assert!((noise.of_mean(2500.0) * 3f64.sqrt() / noise.sd - 1.0).abs() < 1e-12);
    }

    #[test]
    fn one_tokenizer_a_vocabulary_knows_nothing_of_others() {
        assert_eq!(tokenizer_noise(&group_budgets(&SWEEP.points()).unwrap()), None);
    }
}
