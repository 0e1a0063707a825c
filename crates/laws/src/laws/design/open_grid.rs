//! [`OpenRun`], a run that could be trained, and the partly trained grid of one budget.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use crate::laws::input::IsoFlopPoint;
use crate::laws::joint::Place;
use crate::laws::maths::stats::distinct;

/// A run that could be trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenRun {
    /// The declared budget.
    pub budget_flops: f64,
    /// The cost of training it.
    pub flops: f64,
    pub params_nonvocab: f64,
    pub n_vocab: f64,
    pub tokens: f64,
    /// Distinct tokens of the training split, if known.
    pub unique_tokens: Option<f64>,
}

impl OpenRun {
    /// A run that is trained, as it was before.
    pub fn of(point: &IsoFlopPoint) -> Self {
        Self {
            budget_flops: point.budget_flops,
            flops: point.flops,
            params_nonvocab: point.params_nonvocab,
            n_vocab: point.n_vocab,
            tokens: point.tokens,
            unique_tokens: point.about.unique_tokens,
        }
    }

    pub(super) fn place(&self) -> Place {
        Place::new([self.params_nonvocab, self.n_vocab, self.tokens], self.unique_tokens)
    }

    fn level(&self, axis: usize) -> f64 {
        [self.params_nonvocab, self.n_vocab][axis]
    }
}

/// Sizes and vocabularies of a first window: a curve through fewer sizes cannot be tested, and the
/// best of fewer vocabularies has no neighbours.
const WINDOW: [usize; 2] = [5, 3];

/// Sizes and vocabularies that are asked for on each side of the best run.
const MARGIN: [usize; 2] = [2, 1];
/// The axes of a grid: sizes and vocabularies.
const AXES: [usize; 2] = [0, 1];

/// One budget's grid, of which a part is trained.
pub(super) struct OpenGrid {
    pub budget_flops: f64,
    /// The sizes and the vocabularies, rising.
    levels: [Vec<f64>; 2],
    /// The place of each run that is trained or chosen among the levels.
    taken: Vec<[usize; 2]>,
    /// The place of the cell of the lowest mean loss; none if nothing is trained.
    best: Option<[usize; 2]>,
    /// The runs that are left, by their index, with their place among the levels.
    left: Vec<(usize, [usize; 2])>,
}

/// The grids of all budgets that have a run left, rising.
pub(super) fn of_budgets(points: &[IsoFlopPoint], open: &[OpenRun]) -> Vec<OpenGrid> {
    let budgets = distinct(open.iter().map(|run| run.budget_flops));
    budgets.into_iter().map(|budget| OpenGrid::new(budget, points, open)).collect()
}

impl OpenGrid {
    fn new(budget_flops: f64, points: &[IsoFlopPoint], open: &[OpenRun]) -> Self {
        let trained: Vec<(OpenRun, f64)> =
            points.iter().map(|point| (OpenRun::of(point), point.loss)).collect();
        let own = |run: &OpenRun| run.budget_flops == budget_flops;
        let all = || trained.iter().map(|(run, _)| run).chain(open).filter(|run| own(run));
        let levels = AXES.map(|axis| distinct(all().map(|run| run.level(axis))));
        let place = |run: &OpenRun| {
            AXES.map(|axis| levels[axis].partition_point(|level| *level < run.level(axis)))
        };
        let measured: Vec<([usize; 2], f64)> = trained
            .iter()
            .filter(|(run, _)| own(run))
            .map(|(run, loss)| (place(run), *loss))
            .collect();
        let left = open.iter().enumerate().filter(|(_, run)| own(run));
        Self {
            budget_flops,
            best: best(&measured),
            taken: measured.into_iter().map(|(place, _)| place).collect(),
            left: left.map(|(i, run)| (i, place(run))).collect(),
            levels,
        }
    }

    /// Whether no run of it is trained.
    pub fn is_untouched(&self) -> bool {
        self.taken.is_empty()
    }

    /// The runs of the levels nearest to an optimum.
    pub fn window(&self, params_nonvocab: f64, n_vocab: f64) -> Vec<usize> {
        let optimum = [params_nonvocab, n_vocab];
        let near = AXES.map(|axis| nearest(&self.levels[axis], optimum[axis], WINDOW[axis]));
        self.within(|place| AXES.iter().all(|axis| near[*axis].contains(&place[*axis])))
    }

    /// The next sizes and vocabularies on those sides on which the best run has too few.
    pub fn beyond_edges(&self) -> Vec<usize> {
        let Some(best) = self.best else { return Vec::new() };
        let tried = self.tried();
        let short = self.sides().into_iter().filter(|&(axis, at)| {
            let (low, high) = tried[axis].clone().into_inner();
            let end = if at < best[axis] { low } else { high };
            end.abs_diff(best[axis]) < MARGIN[axis]
        });
        short.flat_map(|side| self.line(side)).collect()
    }

    /// The runs of each candidate cell: within the sizes and vocabularies tried or next to them; all cells if none is
    /// left there.
    pub fn cells(&self) -> Vec<Vec<usize>> {
        let near = self.tried().map(|tried| tried.start().saturating_sub(1)..=tried.end() + 1);
        let is_near =
            |place: &[usize; 2]| AXES.iter().all(|axis| near[*axis].contains(&place[*axis]));
        let is_any_near = self.left.iter().any(|(_, place)| is_near(place));
        let mut cells: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
        for (i, place) in self.left.iter().filter(|(_, place)| is_near(place) || !is_any_near) {
            cells.entry(*place).or_default().push(*i);
        }
        cells.into_values().collect()
    }

    /// From the least to the greatest place tried on each axis.
    fn tried(&self) -> [RangeInclusive<usize>; 2] {
        AXES.map(|axis| {
            let places = || self.taken.iter().map(|place| place[axis]);
            places().min().unwrap_or(0)..=places().max().unwrap_or(0)
        })
    }

    /// The places next to those tried, with their axis.
    fn sides(&self) -> Vec<(usize, usize)> {
        let tried = self.tried();
        let of = |axis: usize| {
            let (low, high) = (*tried[axis].start(), *tried[axis].end());
            let next = (high + 1 < self.levels[axis].len()).then_some(high + 1);
            [low.checked_sub(1), next].into_iter().flatten().map(move |at| (axis, at))
        };
        AXES.into_iter().flat_map(of).collect()
    }

    /// The runs at a place next to the range tried.
    fn line(&self, (axis, at): (usize, usize)) -> Vec<usize> {
        let (tried, other) = (self.tried(), 1 - axis);
        self.within(|place| place[axis] == at && tried[other].contains(&place[other]))
    }

    /// Marks the runs of these indices as trained or chosen.
    pub fn take(&mut self, runs: &[usize]) {
        let (taken, left): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.left).into_iter().partition(|(i, _)| runs.contains(i));
        self.taken.extend(taken.into_iter().map(|(_, place)| place));
        self.left = left;
    }

    fn within(&self, is_in: impl Fn(&[usize; 2]) -> bool) -> Vec<usize> {
        self.left.iter().filter(|(_, place)| is_in(place)).map(|(i, _)| *i).collect()
    }
}

/// The place of the lowest mean loss.
fn best(measured: &[([usize; 2], f64)]) -> Option<[usize; 2]> {
    let mut cells: BTreeMap<[usize; 2], (f64, f64)> = BTreeMap::new();
    for (place, loss) in measured {
        let (sum, count) = cells.entry(*place).or_default();
        (*sum, *count) = (*sum + loss, *count + 1.0);
    }
    let means = cells.into_iter().map(|(place, (sum, count))| (place, sum / count));
    means.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(place, _)| place)
}

/// The places of the `count` levels that lie nearest to `at`, as a ratio.
fn nearest(levels: &[f64], at: f64, count: usize) -> Vec<usize> {
    let off = |i: &usize| (levels[*i] / at).ln().abs();
    let mut places: Vec<usize> = (0..levels.len()).collect();
    places.sort_by(|a, b| off(a).total_cmp(&off(b)));
    places.truncate(count);
    places
}
