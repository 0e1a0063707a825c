//! Noise that many runs share: by the test split, and by the tokenizer.
//!
//! All runs of a sweep are measured on the same clips, so a test split that happens to be hard moves all losses
//! together, and seeds do not reveal it. It is estimated from blocks of the split without common recordings. The
//! difficulty of a block is modelled as a smooth function of the cell; deviations of single runs count as run noise.

use crate::laws::input::Cell;
use crate::laws::input::budget::Budget;
use crate::laws::maths::least_squares;
use crate::laws::maths::stats::Normals;
use crate::laws::minima::{Grid, NoiseSource, RunNoise, valley};
use serde::{Deserialize, Deserializer, Serialize, de::Error};
use std::collections::{BTreeMap, BTreeSet};

/// Separates the random streams of other test splits from those of replicates.
const STREAMS: u64 = 1 << 41;

/// The spread of losses over test splits like the one of the runs.
///
/// The split has B blocks without common recordings. Block b is harder than the mean of all by d_b = a_b + s_b ·
/// (ln N_nv, ln V, ln C), with logarithms relative to the best cell of the largest budget; the loss of a cell then
/// has the variance Σ d_b²/B(B − 1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TestNoise {
    /// Standard deviation of the loss of that best cell, in nats.
    pub sd: f64,
    /// B, 2 or more.
    #[serde(deserialize_with = "at_least_two")]
    pub blocks: usize,
    centre: [f64; 3],
    /// a_b and s_b of each block.
    effects: Vec<[f64; 4]>,
}

/// Reads B from a file.
fn at_least_two<'de, D: Deserializer<'de>>(file: D) -> Result<usize, D::Error> {
    let blocks = usize::deserialize(file)?;
    let told = || Error::custom(format!("noise of a test split needs 2 blocks, here {blocks}"));
    (blocks >= 2).then_some(blocks).ok_or_else(told)
}

impl TestNoise {
    /// From the effects of at least two blocks around a cell.
    fn new(centre: [f64; 3], effects: Vec<[f64; 4]>) -> Self {
        let own = Self { sd: 0.0, blocks: effects.len(), centre, effects };
        Self { sd: own.sd_at(centre), ..own }
    }

    /// Standard deviation of the loss of a model (ln N_nv, ln V, ln C).
    fn sd_at(&self, place: [f64; 3]) -> f64 {
        let away: [f64; 3] = std::array::from_fn(|i| place[i] - self.centre[i]);
        let harder = |[level, slopes @ ..]: &[f64; 4]| {
            level + slopes.iter().zip(away).map(|(slope, x)| slope * x).sum::<f64>()
        };
        self.effects.iter().map(|own| harder(own).powi(2)).sum::<f64>().sqrt() * self.of_mean()
    }

    /// Losses of a model on this test split as ones on others.
    pub fn moved(&self, losses: &[f64], place: [f64; 3]) -> Vec<f64> {
        let sd = self.sd_at(place);
        let moved = |(i, loss): (usize, &f64)| {
            let mut normals = Normals::of_stream(STREAMS, i as u64);
            loss + sd * self.student(&mut normals) * normals.draw()
        };
        losses.iter().enumerate().map(moved).collect()
    }

    /// The effect of another test split on the optima of budgets.
    pub(in crate::laws) fn draw(&self, normals: &mut Normals) -> OtherClips {
        let scale = self.student(normals) * self.of_mean();
        let mut slopes = [0.0; 2];
        for [_, size, vocab, _] in &self.effects {
            let weight = scale * normals.draw();
            slopes[0] += weight * size;
            slopes[1] += weight * vocab;
        }
        OtherClips(slopes)
    }

    /// The factor by which a standard deviation from so many blocks may be too small.
    fn student(&self, normals: &mut Normals) -> f64 {
        let dof = self.blocks - 1;
        (dof as f64 / normals.chi_square(dof)).sqrt()
    }

    /// 1/√(B(B − 1)).
    fn of_mean(&self) -> f64 {
        1.0 / ((self.blocks * (self.blocks - 1)) as f64).sqrt()
    }
}

/// The slopes of another test split's difficulty in model size and vocabulary. Its level moves no optimum.
pub(in crate::laws) struct OtherClips([f64; 2]);

impl OtherClips {
    /// The shift of a cell's loss relative to the best of its budget.
    pub fn shift(&self, cell: &Cell, best: &Cell) -> f64 {
        let ln = |own: &Cell| [own.params_nonvocab.ln(), own.n_vocab.max(1.0).ln()];
        let (own, best) = (ln(cell), ln(best));
        (0..2).map(|axis| self.0[axis] * (own[axis] - best[axis])).sum()
    }
}

/// Fewer blocks say nothing about a standard deviation.
const FEWEST: usize = 5;

/// Fits the effects over ascending budgets; `None` if a cell lacks its blocks, there are few, or the cells do not
/// determine them.
pub(in crate::laws) fn test_noise(grids: &[Grid], noise: Option<RunNoise>) -> Option<TestNoise> {
    let largest = grids.last()?;
    let (best, n_blocks) = (largest.best(), largest.best().by_block.len());
    let centre = place(best, largest.budget_flops);
    let mut rows = Vec::new();
    for grid in grids {
        for cells in grid.of_all_shares() {
            let least = cells.iter().map(|cell| cell.loss).fold(f64::INFINITY, f64::min);
            rows.extend(cells.iter().map(|cell| {
                let count =
                    cell.runs * valley(cell.loss - least, RunNoise::sd_or_guess(noise, grids));
                let place = place(cell, grid.budget_flops);
                let away = std::array::from_fn(|i| place[i] - centre[i]);
                Row { away, weight: count.sqrt(), by_block: &cell.by_block }
            }));
        }
    }
    let is_known = n_blocks >= FEWEST && rows.iter().all(|row| row.by_block.len() == n_blocks);
    let effects = is_known.then(|| (0..n_blocks).map(|block| effect(&rows, block)).collect());
    Some(TestNoise::new(centre, effects.flatten()?))
}

/// A cell with its weight.
struct Row<'a> {
    /// Its place relative to the centre.
    away: [f64; 3],
    weight: f64,
    by_block: &'a [f64],
}

/// a_b and s_b of a block; a slope is 0 where all cells lie at one place.
fn effect(rows: &[Row], block: usize) -> Option<[f64; 4]> {
    let varies = |axis: &usize| rows.iter().any(|row| row.away[*axis] != rows[0].away[*axis]);
    let axes: Vec<usize> = (0..3).filter(varies).collect();
    let terms = |row: &Row| {
        let terms = axes.iter().map(|axis| row.away[*axis]);
        [1.0].into_iter().chain(terms).map(|term| row.weight * term).collect()
    };
    let losses: Vec<f64> = rows.iter().map(|row| row.weight * row.by_block[block]).collect();
    let rows: Vec<Vec<f64>> = rows.iter().map(terms).collect();
    let found = least_squares(&rows, &losses)?.coefficients;
    let mut effect = [found[0], 0.0, 0.0, 0.0];
    axes.iter().zip(&found[1..]).for_each(|(axis, slope)| effect[axis + 1] = *slope);
    Some(effect)
}

fn place(cell: &Cell, budget_flops: f64) -> [f64; 3] {
    [cell.params_nonvocab.ln(), cell.n_vocab.max(1.0).ln(), budget_flops.ln()]
}

// Tokenizer noise: the spread of losses between tokenizers of the same vocabulary.

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
    use crate::laws::simulated::SWEEP;

    /// A sweep whose blocks differ by what `of` says of a run, a block's draw, and a draw of its own.
    fn grids(of: impl Fn(&IsoFlopPoint, f64, f64) -> f64) -> Vec<Grid> {
        let mut normals = Normals::of_stream(3, 0);
        let blocks: Vec<f64> = (0..20).map(|_| normals.draw()).collect();
        let mut known = |point: IsoFlopPoint| {
            let by_block = blocks.iter().map(|draw| of(&point, *draw, normals.draw())).collect();
            IsoFlopPoint { about: RunFacts { by_block, ..RunFacts::default() }, ..point }
        };
        let points: Vec<IsoFlopPoint> = SWEEP.points().into_iter().map(&mut known).collect();
        group_budgets(&points).unwrap().iter().filter_map(Grid::new).collect()
    }

    fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
        let values: Vec<f64> = values.collect();
        (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
    }

    /// The deviation of what the smallest model of a budget moves by on other splits, beside the best.
    fn scatter(grids: &[Grid]) -> f64 {
        let (grid, noise) = (&grids[0], test_noise(grids, None).unwrap());
        let shift = |i| {
            let clips = noise.draw(&mut Normals::of_stream(1, i));
            clips.shift(&grid.cells[0], grid.best())
        };
        root_mean_square((0..2000).map(shift))
    }

    #[test]
    fn what_all_losses_have_in_common_moves_no_optimum() {
        let grids = grids(|point, draw, _| (0.4 + 0.1 * (point.budget_flops / 1e10).ln()) * draw);
        let noise = test_noise(&grids, None).unwrap();
        let (best, budget) = (grids[4].best(), grids[4].budget_flops);
        let sd = |budget: f64| (0.4 + 0.1 * (budget / 1e10).ln()) / 20f64.sqrt();
        assert!((noise.sd / sd(budget) - 1.0).abs() < 0.35, "{noise:?}");
        assert!(scatter(&grids) < 1e-9);
        // Student's t of 19 degrees of freedom has a variance of 19/17.
        let moved = |budget| {
            let moved = noise.moved(&[-3.0; 4000], place(best, budget));
            root_mean_square(moved.iter().map(|loss| loss + 3.0)) / (19f64 / 17.0).sqrt()
        };
        assert!((moved(budget) / noise.sd - 1.0).abs() < 0.05);
        let farther = sd(100.0 * budget) / sd(budget);
        assert!((moved(100.0 * budget) / moved(budget) / farther - 1.0).abs() < 1e-6);
    }

    #[test]
    fn blocks_that_large_models_find_harder_move_an_optimum_and_noise_of_runs_does_not() {
        let slope = |point: &IsoFlopPoint| 0.1 * (point.params_nonvocab / 1e4).ln();
        let smooth = scatter(&grids(|point, draw, _| slope(point) * draw));
        let noisy = scatter(&grids(|point, draw, own| slope(point) * draw + 0.1 * own));
        assert!(smooth > 0.02 && (noisy / smooth - 1.0).abs() < 0.3, "{smooth}, {noisy}");
        let noise = scatter(&grids(|_, _, own| 0.1 * own));
        assert!(noise < 0.3 * smooth, "{noise}, {smooth}");
    }

    #[test]
    fn few_blocks_or_a_run_without_them_tell_nothing() {
        let points = SWEEP.points();
        let plain = group_budgets(&points).unwrap();
        let plain: Vec<Grid> = plain.iter().filter_map(Grid::new).collect();
        assert_eq!(test_noise(&plain, None), None);
        let mut known = grids(|_, draw, _| draw);
        known[0].cells[0].by_block.clear();
        assert_eq!(test_noise(&known, None), None);
    }
}

#[cfg(test)]
mod tokenizers_tests {
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
